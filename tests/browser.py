"""Debian's Chromium with WebGPU on a machine without a GPU: shared by the shader tests and the end-to-end tests."""

from __future__ import annotations

import contextlib
import os
import shutil

import psutil

from bench.picture._browser import SOFTWARE_ADAPTER
from bench.room._serving import free_port

__all__ = ["FLAGS", "chromium_path", "draw_politely", "free_port"]

# The last list counts: the first three lines are Playwright's own. The others are pages of the address bar,
# which every window starts in a process of its own, though nobody sees them: 0.9 s of processor time a window.
WITHOUT = (
    "AvoidUnnecessaryBeforeUnloadCheckSync,DestroyProfileOnBrowserClose,HttpsUpgrades,HttpsFirstBalancedModeAutoEnable,"
    "LensOverlay,MediaRouter,PaintHolding,ThirdPartyStoragePartitioning,AvoidCorsURLLoaderRestartOnRedirect,"
    "OptimizationHints,NetworkTimeServiceQuerying,AimEnabled,PreconnectToSearch,"
    "WebUIOmniboxPopup,WebUIOmniboxAimPopup,WebUIOmniboxFullPopup"
)

FLAGS = [*SOFTWARE_ADAPTER, f"--disable-features={WITHOUT}"]


def chromium_path() -> str:
    """The browser's executable: $CHROMIUM or the one on the path. Raises RuntimeError when there is none."""
    path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        raise RuntimeError("Chromium is missing: run `make browser`.")
    return path


def draw_politely() -> None:
    """Let the servers that a test started come before the browsers' graphics processes.

    On a software adapter those take all the processor time that there is, for frames that nobody counts; where Chromium
    runs as root they even have a higher priority than others.
    """
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error, OSError):
            if "--type=gpu-process" in process.cmdline():
                for thread in process.threads():
                    os.setpriority(os.PRIO_PROCESS, thread.id, 10)
