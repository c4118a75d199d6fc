"""Cameras in words, as ``esker render --camera`` takes them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Final

from esker.contract import TerrainSettings
from esker.render.camera import HOME_HEADING_DEG, Camera, Land, Vec3, home, look_at, orbit
from esker.render.surface import Surface

WALK_M: Final = 1.7
"""Height of the eye where only a place on the ground is given, metres; lower on small models."""
ROOM_M: Final = 0.45
"""Room that such an eye has to all sides: the page's (frontend/src/core/camera/floor.ts)."""
HELP: Final = (
    "home, home:HEADING, orbit:AZIMUTH,ELEVATION,DISTANCE (degrees, metres; where the eye stands, seen from the "
    "middle or from target:X,Y,Z, lifted out of the ground), or eye:X,Y,Z,target:X,Y,Z; without a Z the eye stands on "
    "the ground"
)
_PART: Final = re.compile(r"(home|orbit|eye|target)(?::([^:a-z]*))?")


class BadView(ValueError):
    """A camera that cannot be understood; the message is a sentence."""


def camera_of(
    text: str, surface: Surface, settings: TerrainSettings, width: int, height: int, *, land: Land | None = None
) -> Camera:
    """The camera that is meant (see HELP). Raises BadView."""
    parts = parse(text)
    size = settings.size_m
    if "home" in parts:
        heading = parts["home"][0] if parts["home"] else HOME_HEADING_DEG
        return home(size, width, height, heading, land)
    if "eye" in parts:
        if "target" not in parts:
            raise BadView("An eye needs a target: eye:X,Y,Z,target:X,Y,Z.")
        eye, target = _place(parts["eye"], surface, standing_room), _place(parts["target"], surface, _ground)
        try:
            return look_at(eye, target, size, width, height)
        except ValueError as error:
            raise BadView(str(error)) from None
    azimuth, elevation, distance = parts["orbit"]
    if not -89.0 <= elevation <= 90.0 or not 0 < distance <= 1e6:
        raise BadView("An orbit has an elevation from -89 to 90 degrees and a distance above 0 m.")
    pivot = _place(parts.get("target", [size / 2, size / 2]), surface, _ground)
    camera = orbit(azimuth, elevation, distance, pivot, size, width, height)
    x, y, z = camera.eye
    lowest = standing_room(surface, x, y)
    return camera if z >= lowest else look_at((x, y, lowest), pivot, size, width, height)


def standing_room(surface: Surface, x_m: float, y_m: float) -> float:
    """The least height at which an eye has room, metres: over the finest ground below it, and over what rises close
    beside it, where the near plane would else reach into a slope or a wall. Twin of camera/floor.ts."""
    size = surface.size_m
    room = min(ROOM_M, size / 400)
    lowest = _ground(surface, x_m, y_m) + min(WALK_M, size / 100)
    for k in range(8):
        east, north = math.cos(k * math.pi / 4), math.sin(k * math.pi / 4)
        lowest = max(lowest, _ground(surface, x_m + room * east, y_m + room * north) + room)
    return lowest


def turned(text: str, degrees: float) -> str:
    """The view from another side: ``home`` and ``orbit`` turn about the terrain. Raises BadView for an eye."""
    parts = parse(text)
    if "home" in parts:
        return f"home:{(parts['home'][0] if parts['home'] else HOME_HEADING_DEG) + degrees!r}"
    if "orbit" not in parts:
        raise BadView("A turntable needs a view that turns: home or orbit:AZIMUTH,ELEVATION,DISTANCE.")
    azimuth, elevation, distance = parts["orbit"]
    target = parts.get("target")
    more = f",target:{','.join(map(repr, target))}" if target else ""
    return f"orbit:{azimuth + degrees!r},{elevation!r},{distance!r}{more}"


def parse(text: str) -> dict[str, list[float]]:
    """The numbers of a camera by its words. Raises BadView."""
    found: dict[str, list[float]] = {}
    at = 0
    for match in _PART.finditer(text):
        if match.start() != at:
            break
        word, numbers = match.group(1), (match.group(2) or "").strip(",")
        if word in found:
            raise BadView(f"'{word}' stands twice in the camera '{text}'.")
        try:
            found[word] = [float(n) for n in numbers.split(",")] if numbers else []
        except ValueError:
            raise BadView(f"'{numbers}' in the camera '{text}' are no numbers.") from None
        at = match.end()
    counts = {"home": (0, 1), "orbit": (3,), "eye": (2, 3), "target": (2, 3)}
    wrong = [word for word, numbers in found.items() if len(numbers) not in counts[word]]
    if at != len(text) or wrong or not {"home", "orbit", "eye"} & found.keys():
        raise BadView(f"'{text}' is no camera. Say {HELP}.")
    return found


def _place(numbers: list[float], surface: Surface, without_z: Callable[[Surface, float, float], float]) -> Vec3:
    x, y, *z = numbers
    return x, y, z[0] if z else without_z(surface, x, y)


def _ground(surface: Surface, x_m: float, y_m: float) -> float:
    """Height of the finest ground, as it is drawn beside an eye: what levels above the solved ones add may bury one."""
    return surface.height_at(x_m, y_m, surface.levels)
