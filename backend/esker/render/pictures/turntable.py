"""Animations of pictures: GIF, animated PNG and WebP by Pillow, MP4 where ffmpeg is, or a folder of stills."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any, Final

from PIL import Image

MOST_FRAMES: Final = 3600
_PILLOW: Final[dict[str, dict[str, Any]]] = {
    ".gif": {"loop": 0, "optimize": False},
    ".png": {"loop": 0},
    ".webp": {"loop": 0, "quality": 85, "method": 4},
}


def check(output: Path) -> None:
    """Raises ValueError where an animation cannot be written."""
    suffix = output.suffix.lower()
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise ValueError(
            "MP4 needs the program ffmpeg, which is not installed here; .webp, .png and .gif need nothing."
        )
    if suffix == "" and output.exists() and not output.is_dir():
        raise ValueError(f"{output} is a file, not a folder for pictures.")
    if suffix not in ("", ".mp4", *_PILLOW):
        raise ValueError(f"A turntable is written as .mp4, .webp, .png, .gif or into a folder, not as '{suffix}'.")


def write(frames: Iterable[Image.Image], output: Path, fps: float) -> None:
    """Writes the pictures as they come. Raises ValueError (see ``check``), OSError."""
    check(output)
    suffix = output.suffix.lower()
    if suffix == "":
        output.mkdir(exist_ok=True)
        for k, frame in enumerate(frames):
            frame.save(output / f"{k:04d}.png")
        return
    part = output.with_name(f".{output.name}.part")
    try:
        if suffix == ".mp4":
            _mp4(iter(frames), part, fps)
        else:
            _pillow(iter(frames), part, suffix, fps)
        part.replace(output)
    finally:
        part.unlink(missing_ok=True)


def _pillow(frames: Iterator[Image.Image], output: Path, suffix: str, fps: float) -> None:
    first = next(frames)
    if suffix == ".gif":
        # One palette for all, so that colours do not flicker from picture to picture.
        palette = first.quantize(256, dither=Image.Dither.NONE)
        first, frames = palette, (f.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG) for f in frames)
    first.save(
        output, format=suffix[1:].upper(), save_all=True, append_images=frames, duration=1000 / fps, **_PILLOW[suffix]
    )


def _mp4(frames: Iterator[Image.Image], output: Path, fps: float) -> None:
    first = next(frames)
    width, height = first.size
    even = f"crop={width - width % 2}:{height - height % 2}:0:0"
    command = [
        "ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pixel_format", "rgb24", "-video_size",
        f"{width}x{height}", "-framerate", f"{fps:g}", "-i", "-", "-vf", even, "-pix_fmt", "yuv420p", "-crf", "18",
        "-f", "mp4", str(output),
    ]  # fmt: skip
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdin is not None
    try:
        for frame in chain([first], frames):
            process.stdin.write(frame.tobytes())
    except BrokenPipeError:
        pass  # ffmpeg says why below
    except BaseException:
        process.kill()
        process.communicate()
        raise
    _, errors = process.communicate()
    if process.returncode != 0:
        raise OSError(
            f"ffmpeg failed: {errors.decode(errors='replace').strip().splitlines()[-1:] or 'no reason given'}"
        )
