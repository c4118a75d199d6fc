"""Debian's Chromium with WebGPU on a machine without a GPU: shared by the shader tests and the end-to-end tests."""

from __future__ import annotations

import os
import shutil
import socket

# WebGPU in headless Chromium on the software adapter needs all of these (DESIGN 16).
FLAGS = [
    "--no-sandbox",
    "--enable-unsafe-webgpu",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-angle=swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--no-first-run",
]


def chromium_path() -> str:
    """The browser's executable: $CHROMIUM or the one on the path. Raises RuntimeError when there is none."""
    path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        raise RuntimeError("Chromium is missing: run `make browser`.")
    return path


def free_port() -> int:
    """A TCP port of the loopback interface that nobody listens on now."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])
