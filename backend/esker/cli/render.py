"""``esker render``: pictures and turntables of a terrain, without a browser."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TextIO

from PIL import Image

from esker.contract import (
    DEFAULT_LEVEL,
    DEFAULT_REFINED_LEVEL,
    MAX_LEVEL,
    MAX_REFINED_LEVEL,
    Document,
    TerrainSettings,
)
from esker.document.layers import span_m
from esker.render.frame import LOOKS, OVERLAYS, Scene
from esker.render.pictures import turntable
from esker.render.pictures.studio import open_terrain, prepare
from esker.render.pictures.views import HELP, camera_of, parse, turned

STILLS: Final = {".png": {}, ".jpg": {"quality": 92}, ".jpeg": {"quality": 92}, ".webp": {"quality": 90, "method": 6}}
LONGEST_SIDE: Final = 16384
MOST_PIXELS: Final = 7680 * 4320 * 2


def main(argv: list[str]) -> int:
    """Run the command; 0, or 1 with one sentence on standard error. Bad arguments exit with 2, like argparse."""
    options = _parser().parse_args(argv)
    say = Says(sys.stderr, quiet=options.quiet)
    try:
        _check(options)
        _draw(options, say)
    except (OSError, ValueError, RuntimeError, MemoryError) as error:
        say.end()
        print(f"esker render: {str(error) or type(error).__name__}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nesker render: stopped, nothing was written.", file=sys.stderr)
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="esker render", description="Pictures of a terrain, without a browser.")
    p.add_argument("terrain", help="an .esker file, a document as .json, a link, or a starting terrain")
    p.add_argument("-o", "--output", type=Path, required=True,
                   help="a .png, .jpg or .webp; a turntable also .gif, .mp4 (by ffmpeg) or a folder")  # fmt: skip
    p.add_argument("--camera", default="home", metavar="VIEW", help=HELP)
    p.add_argument("--size", type=_size, default=(1920, 1080), metavar="WxH", help="pixels (default 1920x1080)")
    p.add_argument("--look", choices=sorted(LOOKS), help="another look than the terrain's own")
    p.add_argument("--sun", type=_sun, metavar="AZ,EL", help="azimuth (clockwise from north), elevation, degrees")
    p.add_argument("--overlay", choices=sorted(OVERLAYS), default="none")
    p.add_argument("--tau", type=float, default=1.0, metavar="PIXELS", help="screen error that is kept (default 1)")
    p.add_argument("--turntable", type=int, metavar="N", help="an animation of N pictures, once around")
    p.add_argument("--fps", type=float, default=25.0, help="pictures a second of a turntable (default 25)")
    p.add_argument("--level", type=int, choices=range(MAX_LEVEL + 1), default=DEFAULT_LEVEL, metavar="N",
                   help=f"finest level solved as a whole, 0..{MAX_LEVEL} (default {DEFAULT_LEVEL})")  # fmt: skip
    p.add_argument("--refine", type=int, choices=range(MAX_REFINED_LEVEL + 1), default=DEFAULT_REFINED_LEVEL,
                   metavar="N", help=f"finest level refined in view (default {DEFAULT_REFINED_LEVEL})")  # fmt: skip
    p.add_argument("--detail", type=float, metavar="X", help="strength of the detail, 0..4")
    p.add_argument("--plain", action="store_true", help="as the page draws on adapters that are no GPU: faster")
    p.add_argument("--bare", action="store_true", help="without trees, rocks and tufts")
    p.add_argument("--device", help="part of an OpenCL device's name, or 'numpy': what solves")
    p.add_argument("-q", "--quiet", action="store_true", help="no progress on standard error")
    return p


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"'{text}' is no size; say WIDTHxHEIGHT, like 3840x2160")
    width, height = int(match.group(1)), int(match.group(2))
    if not (16 <= width <= LONGEST_SIDE and 16 <= height <= LONGEST_SIDE) or width * height > MOST_PIXELS:
        raise argparse.ArgumentTypeError(f"a side has 16 to {LONGEST_SIDE} pixels, a picture {MOST_PIXELS} at most")
    return width, height


def _sun(text: str) -> tuple[float, float]:
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is no sun; say AZIMUTH,ELEVATION, like 115,12") from None
    if not 0 <= elevation <= 90:
        raise argparse.ArgumentTypeError("the sun stands 0 to 90 degrees above the horizon")
    return azimuth % 360, elevation


def _check(options: argparse.Namespace) -> None:
    """Checks all that must be right before the long part begins. Raises ValueError."""
    output: Path = options.output
    if not options.tau > 0:
        raise ValueError("The screen error is above 0 pixels.")
    if not output.absolute().parent.is_dir():
        raise ValueError(f"There is no folder {output.absolute().parent}.")
    parse(options.camera)
    if options.turntable is not None:
        if not 2 <= options.turntable <= turntable.MOST_FRAMES:
            raise ValueError(f"A turntable has 2 to {turntable.MOST_FRAMES} pictures.")
        if not 1 <= options.fps <= 120:
            raise ValueError("A turntable shows 1 to 120 pictures a second.")
        turned(options.camera, 0.0)
        turntable.check(output)
    elif output.suffix.lower() not in STILLS:
        raise ValueError(f"Pictures are written as {', '.join(STILLS)}, not as '{output.suffix or output.name}'.")


def _draw(options: argparse.Namespace, say: Says) -> None:
    from esker.render.reference import Reference
    from esker.solve.solver import Solver

    opened = open_terrain(options.terrain)
    document = _changed(opened.document, options)
    reference = Reference("plain" if options.plain else "rich")  # before the solve: it fails where there is no OpenGL
    solver = Solver(options.device, max_level=options.level)
    say.say(f"solving on {solver.device_name}")
    stage = prepare(document, solver, grids=opened.grids, level=options.level, refined=options.refine)

    def picture(view: str, progress: Callable[[float], None]) -> Image.Image:
        camera = camera_of(view, stage.surface, document.settings, *options.size, land=stage.land)
        scene = Scene(
            document.settings,
            camera,
            options.tau,
            overlay=options.overlay,
            ground_m=span_m(document.layers),
            instances=not options.bare and not options.plain,
        )
        made = reference.draw(stage.surface, scene, stage.channels, progress)
        if made.tau_px > options.tau * 1.001:
            say.line(f"the picture needs too many tiles: screen error {made.tau_px:.2f} instead of {options.tau:g} px")
        return Image.fromarray(made.pixels)

    say.say(f"drawing on {reference.device}")
    if options.turntable is None:
        image = picture(options.camera, lambda part: say.share("drawing", part))
        _save(image, options.output)
    else:
        count = options.turntable
        frames = (
            picture(
                turned(options.camera, 360.0 * k / count),
                lambda part, k=k: say.share(f"picture {k + 1} of {count}", (k + part) / count),  # type: ignore[misc]
            )
            for k in range(count)
        )
        turntable.write(frames, options.output, options.fps)
    say.end()


def _changed(document: Document, options: argparse.Namespace) -> Document:
    """The document with what the command line says of its settings."""
    change: dict[str, Any] = {}
    if options.look is not None:
        change["look"] = options.look
    if options.sun is not None:
        change["sun_azimuth_deg"], change["sun_elevation_deg"] = options.sun
    if options.detail is not None:
        change["detail"] = options.detail
    settings = TerrainSettings.model_validate({**document.settings.model_dump(), **change})
    return document.model_copy(update={"settings": settings})


def _save(image: Image.Image, output: Path) -> None:
    """Whole or not at all: a picture that is being written has another name."""
    part = output.with_name(f".{output.name}.part")
    suffix = output.suffix.lower()
    try:
        image.save(part, format={".jpg": "JPEG", ".jpeg": "JPEG"}.get(suffix, suffix[1:].upper()), **STILLS[suffix])
        part.replace(output)
    finally:
        part.unlink(missing_ok=True)


class Says:
    """Progress: one line that changes on a terminal, plain lines elsewhere."""

    def __init__(self, stream: TextIO, *, quiet: bool) -> None:
        self._stream, self._quiet, self._live = stream, quiet, stream.isatty()
        self._open = False
        self._tenth = -1

    def say(self, text: str) -> None:
        """A new step."""
        self._tenth = -1
        if self._live and not self._quiet:
            self._stream.write(f"\r\x1b[K{text} ...")
            self._stream.flush()
            self._open = True
        else:
            self.line(text)

    def share(self, text: str, part: float) -> None:
        """How much of a step is done, 0..1; lines only every tenth."""
        if self._live:
            self.say(f"{text}: {part:.0%}")
        elif int(part * 10) != self._tenth:
            self._tenth = int(part * 10)
            self.line(f"{text}: {part:.0%}")

    def line(self, text: str) -> None:
        """A line that stays."""
        self.end()
        if not self._quiet:
            self._stream.write(f"{text}\n")
            self._stream.flush()

    def end(self) -> None:
        """Closes a line that changes."""
        if self._open:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
        self._open = False
