"""How much of real grids lies in kernels: ``python -m bench.ground._patchwork_cover FOLDER... > patchwork_cover.json``.

Every file of the folders that may be imported, with the default answers to its questions: share of valid samples, of
these the share in kernels of 7 x 7 samples and more and in all with the rim (``patchwork.rim``), and the patches of
each kind. The table in docs/patchwork.md is made of it by ``bench.report``.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

import numpy as np

from esker import contract as c
from esker.importing import run
from esker.importing.convert import convert
from esker.importing.examine import examine
from esker.importing.placement.placing import Terrain
from esker.importing.refusal import ImportRefused
from esker.patchwork.raster import errors, patches, rasters
from esker.patchwork.raster.rasters import Raster
from esker.version import VERSION

SIZE_M: Final = 65_536.0
BEGIN: Final = "<!-- cover: written by `python -m bench.report` -->"
END: Final = "<!-- end of cover -->"


def made(path: Path, folder: Path) -> Raster | None:
    """The raster of a file, in ``folder``; None if it is refused. Read in this process: these files are known."""
    (folder / "work").mkdir()
    try:
        report = examine(path, path.name, folder / "work", {}, None, lambda _: None).report
        answers = c.ImportAnswers(answers={question.id: question.default for question in report.questions})
        terrain = Terrain(run.suggest_place(report), SIZE_M)
        convert(path, path.name, answers, terrain, folder / "raster", folder / "work", lambda *_: None)
    except ImportRefused:
        return None
    return rasters.read(folder / "raster")


def shares(raster: Raster) -> dict[str, Any]:
    """Valid samples of a raster, in which kernels they lie, and its patches."""
    heights, rim = raster.heights, raster.errors.rim
    whole = errors.whole_kernels(heights)
    valid = int(np.count_nonzero(~np.isnan(heights)))
    in_rim = int(rim[:, 2:].prod(axis=1).sum())
    in_blocks = heights.size
    if whole is not None:
        size = patches.SMALLEST_KERNEL
        wide, tall = (np.diff(np.append(np.arange(0, side, size), side)) for side in heights.shape[::-1])
        in_blocks = int((whole * tall[:, None] * wide).sum())
    return {
        "rows": heights.shape[0],
        "cols": heights.shape[1],
        "valid": valid / heights.size,
        "in_blocks": in_blocks / valid,
        "in_all": (in_blocks + in_rim) / valid,
        "patches": raster.errors.count - len(rim),
        "rim_patches": len(rim),
    }


def table(result: dict[str, Any]) -> str:
    """Table of the files that hold nodata; below it stands how many hold none."""
    head = "| file | samples | valid | of these in kernels of 7² and more | in all | patches | of rims |"
    lines = [head, "|" + "---|" * 7]
    plain = []
    for name, one in result["files"].items():
        if one["valid"] == 1:
            plain.append(one)
            continue
        percents = [f"{100 * one[share]:.1f} %" for share in ("valid", "in_blocks", "in_all")]
        cells = [
            name,
            f"{one['rows']:,} × {one['cols']:,}",
            *percents,
            f"{one['patches']:,}",
            f"{one['rim_patches']:,}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    least = min((one["in_all"] for one in plain), default=1.0)
    return (
        "\n".join(lines)
        + f"\n\n{len(plain)} further files hold no nodata: {100 * least:.0f} % lies in kernels, none in rims."
    )


def document(text: str, result: dict[str, Any]) -> str:
    """A page with its table renewed. Raises ValueError when the markers are missing."""
    if BEGIN not in text or END not in text:
        raise ValueError("docs/patchwork.md has no place for the table of covers")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    return f"{before}{BEGIN}\n\n{table(result)}\n\n{END}{after}"


def main(folders: list[Path]) -> dict[str, Any]:
    """All files of some folders."""
    found = {}
    for path in sorted(path for folder in folders for path in folder.iterdir() if path.is_file()):
        with tempfile.TemporaryDirectory(prefix="esker-cover-") as work:
            raster = made(path, Path(work))
            if raster is not None:
                found[path.name] = shares(raster)
    return {"bench": "patchwork_cover", "version": VERSION, "files": found}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main([Path(name) for name in sys.argv[1:]]), indent=1) + "\n")
