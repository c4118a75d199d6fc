"""Zip files: one elevation file inside, unpacked here with bounds; GDAL's own /vsizip is never used."""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from esker.importing.refusal import ImportRefused

ELEVATION_SUFFIXES: Final = frozenset(
    {
        ".hgt",
        ".tif",
        ".tiff",
        ".asc",
        ".img",
        ".dt0",
        ".dt1",
        ".dt2",
        ".png",
        ".raw",
        ".r8",
        ".r16",
        ".r32",
        ".f32",
        ".npy",
    }
)
MAX_MEMBERS: Final = 256
MAX_MEMBER_BYTES: Final = 1 << 30
COPY_BYTES: Final = 1 << 20
MAX_TEXT_BYTES: Final = 1 << 16
"""Bytes of a text file beside a grid."""


def extract(archive: zipfile.ZipFile, info: zipfile.ZipInfo, to: Path, limit: int) -> Path:
    """Unpacks one member to the file ``to`` (never to a name of the archive's). Raises ImportRefused."""
    too_large = ImportRefused(f"{info.filename[:40]!r} in the zip file would take more than {limit >> 20} MiB.")
    if info.flag_bits & 1:
        raise ImportRefused("The zip file is encrypted.")
    if info.file_size > limit:
        raise too_large
    try:
        with archive.open(info) as source, to.open("wb") as target:
            left = limit
            while chunk := source.read(COPY_BYTES):
                left -= len(chunk)
                if left < 0:
                    raise too_large
                target.write(chunk)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OSError) as error:
        raise ImportRefused(f"The zip file is broken: {info.filename[:40]!r} cannot be unpacked.") from error
    return to


def open_zip(path: Path) -> zipfile.ZipFile:
    """Raises ImportRefused when the directory of the zip file cannot be read or is too long."""
    try:
        archive = zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, EOFError) as error:
        raise ImportRefused("It starts like a zip file but is broken or cut off.") from error
    if len(archive.infolist()) > MAX_MEMBERS:
        raise ImportRefused(f"The zip file holds {len(archive.infolist())} files; at most {MAX_MEMBERS} are looked at.")
    return archive


def is_npz(archive: zipfile.ZipFile) -> bool:
    """True when all that is inside are NumPy arrays, as np.savez writes."""
    names = archive.namelist()
    return bool(names) and all(name.endswith(".npy") and "/" not in name for name in names)


@dataclass(frozen=True)
class Unpacked:
    """The one elevation file of an archive. ``name``: its own; ``prj``: the text of a .prj file of the same name, None
    where there is none; ``world``: name and text of its world file, None where there is none."""

    path: Path
    name: str
    prj: str | None = None
    world: tuple[str, str] | None = None


def world_suffixes(suffix: str) -> tuple[str, ...]:
    """What world files of a kind of picture are called: .tfw, .tifw and .wld for .tif."""
    letters = suffix.removeprefix(".").lower()
    return tuple(dict.fromkeys((f".{letters[:1]}{letters[-1:]}w", f".{letters}w", ".wld")))


def unpack(archive: zipfile.ZipFile, workdir: Path) -> Unpacked:
    """The one elevation file inside, and what lies beside it under its name, in letters of either case.

    Raises ImportRefused when there is none, or more than one.
    """
    files = [info for info in archive.infolist() if not info.is_dir() and not info.filename.startswith("__MACOSX/")]
    grids = [info for info in files if PurePosixPath(info.filename).suffix.lower() in ELEVATION_SUFFIXES]
    if len(grids) != 1:
        raise ImportRefused(
            "The zip file holds no elevation file." if not grids else
            f"The zip file holds {len(grids)} elevation files; bring them in one by one."
        )  # fmt: skip
    name = PurePosixPath(grids[0].filename)
    grid = extract(archive, grids[0], workdir / f"member{name.suffix.lower()}", MAX_MEMBER_BYTES)

    def beside(suffixes: tuple[str, ...]) -> tuple[str, str] | None:
        wanted = [str(name.with_suffix(suffix)).lower() for suffix in suffixes]
        found = next((info for one in wanted for info in files if info.filename.lower() == one), None)
        if found is None:
            return None
        text = extract(archive, found, workdir / f"beside{suffixes[0]}", MAX_TEXT_BYTES).read_text("utf-8", "replace")
        return PurePosixPath(found.filename).name, text

    prj, world = beside((".prj",)), beside(world_suffixes(name.suffix))
    return Unpacked(grid, name.name, None if prj is None else prj[1], world)
