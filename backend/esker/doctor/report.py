"""One file with all that a machine can tell in five minutes, without anybody beside it: ``esker doctor --report FILE``.

Each part runs in a child with a time of its own, so that a driver that hangs or ends its process costs one part only.
The file is written after each part.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from esker.doctor.solving import ABSENT
from esker.version import VERSION

FORMAT: Final = 1
WHOLE_SECONDS: Final = 290.0
SOAK_SECONDS: Final = 120.0
SECONDS: Final = {"findings": 60.0, "kernels": 60.0, "soak": SOAK_SECONDS + 30.0, "bench": WHOLE_SECONDS}
"""Longest time of each part, in the order in which they run; the whole bound counts too."""


def write(
    file: Path, device: str | None, data: Path, soak_seconds: float, say: Callable[[str], None]
) -> dict[str, Any]:
    """Runs all parts and returns what stands in the file. Raises OSError where the file cannot be written."""
    end = time.monotonic() + WHOLE_SECONDS
    report: dict[str, Any] = {
        "esker_doctor": FORMAT, "version": VERSION, "when": time.strftime("%Y-%m-%d %H:%M"), "device": device,
    }  # fmt: skip
    file.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    for name, most in SECONDS.items():
        # The parts that come get the time that is left. The bench takes all of it, and gives what it has by then.
        left = max(5.0, min(most, end - time.monotonic()))
        say(f"{name}: {left:.0f} s at most ...")
        began = time.monotonic()
        report[name] = part(name, left, {"device": device, "data": str(data), "soak_seconds": soak_seconds})
        report.setdefault("seconds", {})[name] = round(time.monotonic() - began, 1)
        file.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return report


def part(name: str, seconds: float, given: dict[str, Any]) -> Any:
    """Returns what one part says in its last whole line; with ``failed`` where it did not come to its end."""
    command = [sys.executable, "-m", "esker.doctor", name, json.dumps(given)]
    failed = ""
    try:
        done = subprocess.run(command, capture_output=True, timeout=seconds, check=False)
        out, errors = done.stdout, done.stderr
        if done.returncode:
            failed = f"It ended with status {done.returncode}: {_last(errors)}"
    except subprocess.TimeoutExpired as late:
        out, failed = late.stdout or b"", f"It was ended after {seconds:.0f} s."
    said: Any = None
    for line in out.split(b"\n")[:-1]:
        try:
            said = json.loads(line)
        except ValueError:
            continue
    if not failed:
        return said
    return (said if isinstance(said, dict) else {}) | {"failed": failed}


def _last(text: bytes) -> str:
    lines = text.decode("utf-8", "replace").strip().splitlines()
    return lines[-1][:300] if lines else "without a word"


def right(report: dict[str, Any]) -> bool:
    """Returns whether nothing was found broken. A bench that had not the time to end is no fault."""
    findings = report.get("findings")
    return (
        isinstance(findings, list)
        and all(found["state"] != "broken" for found in findings)
        and all(report[name].get("right", False) or _absent(report[name]) for name in ("kernels", "soak"))
    )


def _absent(part: dict[str, Any]) -> bool:
    """Returns whether there is no OpenCL, so that no kernels were tried."""
    return all(ABSENT in str(part.get(kind, {}).get("failed", "")) for kind in ("rows", "tiles"))
