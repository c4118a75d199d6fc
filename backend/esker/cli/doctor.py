"""``esker doctor``: says what this machine has, what it lacks, and whether it solves right."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Final

from esker.doctor import findings, report, solving
from esker.version import VERSION

MARKS: Final = {"good": "ok     ", "poor": "note   ", "broken": "BROKEN "}
SEND: Final = "Nothing personal is in it but the name of your processor and the folder of the data; look, and send it."


def main(argv: list[str]) -> int:
    """Looks, prints; the exit status is 1 where something is broken."""
    parser = argparse.ArgumentParser(prog="esker doctor", description=__doc__)
    parser.add_argument("--device", help="part of the name of the OpenCL device, or numpy")
    parser.add_argument("--data", type=Path, default=Path("data"), metavar="DIR", help="folder of the database")
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")
    help_ = f"five minutes, unattended: also all kernels against NumPy, a soak of {report.SOAK_SECONDS:g} s and times"
    parser.add_argument("--report", type=Path, metavar="FILE.json", help=help_)
    parser.add_argument("--soak-seconds", type=float, default=report.SOAK_SECONDS, help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    if options.report is not None:
        return _report(options)
    found: list[findings.Finding] = []
    for finding in (*findings.look(options.data), *solving.devices(options.device)):
        found.append(finding)
        if not options.json:
            sys.stdout.write(f"{MARKS[finding.state]}{finding.name}: {finding.text}\n")
            sys.stdout.flush()
    if options.json:
        answer = {"version": VERSION, "findings": [asdict(finding) for finding in found]}
        sys.stdout.write(json.dumps(answer, indent=1) + "\n")
    return int(any(finding.state == "broken" for finding in found))


def _report(options: argparse.Namespace) -> int:
    def say(line: str) -> None:
        sys.stderr.write(f"{line}\n")

    try:
        made = report.write(options.report, options.device, options.data, options.soak_seconds, say)
    except OSError as error:
        sys.stderr.write(f"esker: {options.report} cannot be written: {error}\n")
        return 1
    good = report.right(made)
    if options.json:
        sys.stdout.write(json.dumps(made, indent=1) + "\n")
    say(f"{options.report}: {'all is right' if good else 'something is broken'}. {SEND}")
    return int(not good)
