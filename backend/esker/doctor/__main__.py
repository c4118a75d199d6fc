"""One part of a report, in a process of its own: JSON on stdout, a line each time that there is more."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from esker.doctor import findings, solving
from esker.process import system

SIZES = (3, 4, 5, 6)
"""Levels of the bench, in this order: 513² to 4097²."""


def main(name: str, given: dict[str, Any]) -> int:
    """Runs the part."""
    system.speak_utf8()
    device = given["device"]
    match name:
        case "findings":
            found = [*findings.look(Path(given["data"])), *solving.devices(device)]
            _say([asdict(finding) for finding in found])
        case "kernels":
            _say(solving.kernels(device))
        case "soak":
            _say(solving.soak(device, given["soak_seconds"]))
        case "bench":
            for so_far in solving.times(device, SIZES):
                _say(so_far)
    return 0


def _say(what: Any) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], json.loads(sys.argv[2])))
