"""Draws the README's pictures of the looks, of water and of the ground at one's feet, with ``esker render``.

``python docs/pictures/gallery.py [name ...]`` writes docs/pictures/<name>.webp; ``make pictures`` draws all of them. No
browser and no GPU are needed; a picture takes about half a minute on two cores.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SIZE = "1600x1000"
SHOTS: dict[str, list[str]] = {
    "look-natural": ["alpine-ridge", "--sun", "128,14", "--camera", "eye:260,240,640,target:2000,2350,360"],
    "look-alpine": [
        *("alpine-ridge", "--look", "alpine", "--sun", "128,10"),
        *("--camera", "eye:700,300,620,target:2000,2500,420"),
    ],
    "look-desert": ["canyon", "--sun", "236,20", "--camera", "eye:1500,1400,420,target:2400,2500,60"],
    "look-paper": ["figure-six", "--look", "paper", "--camera", "eye:3500,-2900,2700,target:2080,1850,20"],
    "water": ["volcanic-island", "--sun", "110,12", "--camera", "eye:3500,300,90,target:2200,1900,150"],
    "lake": ["volcanic-island", "--sun", "128,22", "--camera", "eye:2330,1660,900,target:2050,2130,500"],
    "close-up": [
        *("alpine-ridge", "--sun", "222,12", "--refine", "10"),
        *("--camera", "eye:1650,1340,target:2100,2600,420"),
    ],
    "real-crater": ["helens", "--camera", "orbit:20,22,2600,target:1450,1200,2000"],
    "real-rainier": ["rainier", "--camera", "orbit:318,9,46000,target:52000,14000,2000"],
}


def main() -> None:
    """Draws the named pictures, or all."""
    for name in sys.argv[1:] or list(SHOTS):
        out = HERE / f"{name}.webp"
        command = [sys.executable, "-m", "esker", "render", *SHOTS[name], "--size", SIZE, "-o", str(out), "--quiet"]
        subprocess.run(command, check=True)
        sys.stdout.write(f"{name}: {out.stat().st_size // 1024} KiB\n")


if __name__ == "__main__":
    main()
