"""Damaged variants of files of every format, examined one by one under the bounds of the process that reads.

``python -m tests.importing.fuzz FOLDER SEED``: writes how each variant ended; the status is 1 when one
ended neither with a report nor with a refusal.
"""

from __future__ import annotations

import random
import sys
import tempfile
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from esker.importing import limits
from esker.importing.examine import examine
from esker.importing.refusal import ImportRefused

TRUNCATIONS: Final = 4
FLIPS: Final = 8
HEADER_BYTES: Final = 600
LEFT_OUT: Final = frozenset(
    {"mapbox.png", "terrarium.png", "cog.tif", "bigtiff.tif", "mirrored.tif", "upside_down.tif"}
)
"""Like others, or slow."""


def variants(data: bytes, rng: random.Random) -> Iterator[bytes]:
    """Cut off, changed in the header, changed anywhere, and with a run of other bytes."""
    for _ in range(TRUNCATIONS):
        yield data[: rng.randrange(len(data))]
    for k in range(FLIPS):
        changed = bytearray(data)
        end = min(HEADER_BYTES, len(data)) if k % 2 else len(data)
        for _ in range(rng.choice((1, 2, 8))):
            changed[rng.randrange(end)] ^= 1 << rng.randrange(8)
        if k % 4 == 0:
            start = rng.randrange(len(data))
            changed[start : start + 16] = rng.randbytes(16)
        yield bytes(changed)


def main(folder: str, seed: str) -> int:
    """Examines all variants; 1 when one ended as none may."""
    limits.apply("inspect")
    rng = random.Random(int(seed))
    bad = 0
    for path in sorted(Path(folder).iterdir()):
        if path.name in LEFT_OUT:
            continue
        for number, data in enumerate(variants(path.read_bytes(), rng)):
            with tempfile.TemporaryDirectory() as workdir:
                damaged = Path(workdir) / "damaged"
                damaged.write_bytes(data)
                sys.stdout.write(f"{path.name} {number} ")
                sys.stdout.flush()
                try:
                    report = examine(damaged, path.name, Path(workdir), {}, None, lambda _: None).report
                    assert -1e6 < float(report.low_m or 0.0) <= float(report.high_m or 0.0) < 1e6
                    sys.stdout.write(f"{report.verdict}\n")
                except ImportRefused as refusal:
                    sys.stdout.write(f"refused: {refusal}\n")
                except Exception:
                    bad += 1
                    sys.stdout.write(f"CRASH\n{traceback.format_exc()}\n")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
