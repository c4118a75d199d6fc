"""``.esker`` files that hold elevation grids (SPEC D33)."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from esker import Stroke
from esker import contract as c
from esker.document import archive
from esker.document.archive import ArchiveError
from esker.document.ops import Refusal, check_document
from esker.patchwork.raster import rasters
from esker.patchwork.raster.rasters import Raster
from esker.server import upload
from esker.server.upload import read_archive
from esker.store.grids import GridStore

HEIGHTS = np.add.outer(np.arange(30.0), np.arange(40.0)).astype(np.float32)
HEIGHTS[3:5, 7:9] = np.nan
WARP = np.zeros((2, 3, 2)) + 0.25


def _layer(raster: Raster, layer_id: str = "v", **fields: Any) -> c.Layer:
    return c.Layer(
        id=layer_id,
        content=raster.digest,
        facts=raster.facts(),
        anchor=(0, 0),
        spacing_m=(5, 5),
        accuracy_m=1,
        **fields,
    )


@pytest.fixture(scope="module")
def grids() -> dict[str, Raster]:
    made = (rasters.build(HEIGHTS), rasters.build(HEIGHTS + 1, WARP))
    return {raster.digest: raster for raster in made}


@pytest.fixture(scope="module")
def document(grids: dict[str, Raster]) -> c.Document:
    plain, bent = grids.values()
    return c.Document(id="t", layers=(_layer(plain),), deleted_layers=(_layer(bent, "d"),))


def _again(data: bytes, **change: bytes | None) -> bytes:
    """The file with members replaced, added, or (None) left out; in their names __ is / and _dot_ a dot."""
    out = io.BytesIO()
    named = {name.replace("__", "/").replace("_dot_", "."): value for name, value in change.items()}
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            value = named.pop(name, old.read(name))
            if value is not None:
                new.writestr(name, value)
        for name, value in named.items():
            new.writestr(name, value or b"")
    return out.getvalue()


def test_grids_go_and_come_back(document: c.Document, grids: dict[str, Raster], tmp_path: Path) -> None:
    data = archive.dumps(document, grids)
    assert data == archive.dumps(document, grids), "the same bytes for the same document"
    assert archive.loads(data) == document
    found = archive.load_grids(data)
    assert found.keys() == grids.keys()
    for digest, grid in found.items():
        again = rasters.build(grid.heights, grid.warp)
        assert again.digest == digest
        np.testing.assert_array_equal(grid.heights, grids[digest].heights)
    with io.BytesIO(data) as file:
        assert archive.unpack(file, tmp_path) == document
    assert {path.name for path in tmp_path.iterdir()} == {
        *(f"{digest}.npy" for digest in grids),
        f"{document.deleted_layers[0].content}.warp.npy",
    }


def test_what_has_no_layers_is_a_file_for_older_versions(grids: dict[str, Raster]) -> None:
    for given in (None, grids):
        with zipfile.ZipFile(io.BytesIO(archive.dumps(c.Document(id="t"), given))) as file:
            assert json.loads(file.read("esker.json"))["version"] == 2
            assert file.namelist() == ["esker.json", "document.json"]


def test_what_has_gullies_is_a_file_for_version_six() -> None:
    """SPEC F201: what has none is written as before, and a file that does not say has none."""
    plain = c.Document(id="t")
    worn = plain.model_copy(update={"settings": c.TerrainSettings(erosion=1.0, hold=0.5)})
    brush = Stroke.paint([(500, 500), (900, 700)], "erosion", -1.0)
    painted = plain.model_copy(update={"strokes": (brush,)})
    for document, version in ((plain, 2), (worn, 6), (painted, 6)):
        data = archive.dumps(document)
        with zipfile.ZipFile(io.BytesIO(data)) as file:
            assert json.loads(file.read("esker.json"))["version"] == version
        assert archive.loads(data) == document


def test_what_has_a_task_is_a_file_for_this_version() -> None:
    """SPEC L94: the task travels with the terrain; what has none is written as before."""
    settings = c.TerrainSettings(task=c.Task(title="Dam it", goal=c.AreaGoal(level_m=5, at_least_m2=1e6)))
    document = c.Document(id="t", settings=settings)
    data = archive.dumps(document)
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        assert json.loads(file.read("esker.json"))["version"] == archive.VERSION == 7
    assert archive.loads(data) == document


def test_a_grid_that_is_missing(document: c.Document, grids: dict[str, Raster]) -> None:
    with pytest.raises(ArchiveError, match="missing"):
        archive.dumps(document)
    live = document.layers[0].content
    data = archive.dumps(document, {live: grids[live]})
    assert archive.loads(data).deleted_layers == (), "a tombstone without its grid could not be restored"
    with pytest.raises(ArchiveError, match="lacks the elevation grid"):
        archive.loads(_again(data, **{f"grids__{live}_dot_npy": None}))


def test_too_large_grids(document: c.Document, grids: dict[str, Raster], monkeypatch: pytest.MonkeyPatch) -> None:
    data = archive.dumps(document, grids)
    monkeypatch.setattr(archive, "MAX_GRIDS_BYTES", 5000)
    with pytest.raises(ArchiveError, match="larger than"):
        archive.dumps(document, grids)
    for read in (archive.loads, archive.load_grids):
        with pytest.raises(ArchiveError, match="unpack to more"):
            read(data)


def _npy(array: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.save(out, array, allow_pickle=True)
    return out.getvalue()


@pytest.mark.parametrize(
    "bad",
    [
        b"",
        b"no array",
        _npy(HEIGHTS)[:-100],
        _npy(HEIGHTS.astype(np.float64)),
        _npy(HEIGHTS[0]),
        _npy(np.asfortranarray(HEIGHTS)),
        _npy(np.array([[{"a": 1}]], dtype=object)),
        _npy(HEIGHTS).replace(b"(30, 40)", b"(99, 99)"),
        _npy(HEIGHTS).replace(b"(30, 40)", b"(-3, 40)"),
    ],
)
def test_what_is_no_grid(document: c.Document, grids: dict[str, Raster], bad: bytes, tmp_path: Path) -> None:
    name = f"grids__{document.layers[0].content}_dot_npy"
    data = _again(archive.dumps(document, grids), **{name: bad})
    with pytest.raises(ArchiveError, match="damaged"):
        archive.load_grids(data)
    with io.BytesIO(data) as file, pytest.raises(ArchiveError, match="damaged"):
        archive.unpack(file, tmp_path)


def test_the_process_that_reads_makes_rasters(document: c.Document, grids: dict[str, Raster], tmp_path: Path) -> None:
    """Mipmaps and errors are made anew; what is not the grid that its layer names is refused."""
    store = GridStore(tmp_path)
    work = store.work()
    path = work / "a.esker"
    path.write_bytes(archive.dumps(document, grids))
    assert asyncio.run(read_archive(path, work, lambda: asyncio.Semaphore(1))) == document
    for digest, raster in grids.items():
        store.keep(work / digest, digest)
        kept = store.read(digest)
        assert rasters.verify(kept)
        for made, mip in zip(kept.mips, raster.mips, strict=True):
            np.testing.assert_array_equal(made, mip)
    name = f"grids__{document.layers[0].content}_dot_npy"
    path.write_bytes(_again(path.read_bytes(), **{name: _npy(HEIGHTS + 9)}))
    with pytest.raises(ArchiveError, match="not the one"):
        asyncio.run(read_archive(path, store.work(), lambda: asyncio.Semaphore(1)))


def test_the_first_file_with_grids_on_a_machine_waits_for_their_loops(
    document: c.Document, grids: dict[str, Raster], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC H566: compiled by its reader they take longer than it may; and a file without any waits for none."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "loops"))  # nothing is compiled on this machine
    said: list[str] = []
    read = upload._read

    async def noted(*arguments: Any) -> Any:
        said.append(str(arguments[3]))
        return await read(*arguments)

    async def compiled() -> None:
        said.append("compiled")
        monkeypatch.delenv("NUMBA_CACHE_DIR")

    monkeypatch.setattr(upload, "_read", noted)
    monkeypatch.setattr("esker.importing.warm.begin", object)
    monkeypatch.setattr("esker.importing.warm.loops", compiled)
    path = tmp_path / "a.esker"
    path.write_bytes(archive.dumps(document.model_copy(update={"layers": (), "deleted_layers": ()})))
    assert asyncio.run(read_archive(path, tmp_path, contextlib.nullcontext)).layers == ()
    assert said == ["coming"]
    path.write_bytes(archive.dumps(document, grids))
    assert asyncio.run(read_archive(path, tmp_path, contextlib.nullcontext)) == document
    assert said[1:] == ["coming", "compiled", str(upload._kept())]


def test_a_reader_that_has_to_compile_has_time_for_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC H566: where no disk keeps loops, say."""
    path = tmp_path / "a.esker"
    path.write_bytes(b"")
    monkeypatch.setattr("esker.importing.warm.record", lambda: tmp_path / "none")
    assert upload._kept() is upload.Loops.MISSING
    usual = upload.cpu_seconds(path, upload.Loops.KEPT)
    assert upload.cpu_seconds(path, upload.Loops.MISSING) >= usual + 300
    monkeypatch.setattr("esker.importing.warm.record", lambda: path)
    assert upload._kept() is upload.Loops.KEPT


@pytest.mark.parametrize(
    ("layers", "deleted", "code"),
    [
        (("a", "a"), (), "duplicate_layer"),
        (("a",), ("a",), "duplicate_layer"),
        (tuple(f"v{k}" for k in range(c.MAX_LAYERS + 1)), (), "too_many_layers"),
        ((), tuple(f"v{k}" for k in range(c.MAX_LAYERS + 1)), "too_many_layers"),
        (("high",), (), "out_of_domain"),
    ],
)
def test_documents_that_no_ops_could_have_made(
    layers: tuple[str, ...], deleted: tuple[str, ...], code: str, grids: dict[str, Raster]
) -> None:
    """SPEC D32."""
    raster = next(iter(grids.values()))

    def made(names: tuple[str, ...]) -> tuple[c.Layer, ...]:
        return tuple(_layer(raster, name, scale=1000.0 if name == "high" else 1.0, lift_m=20_000.0) for name in names)

    settings = c.TerrainSettings(size_m=5000.0)
    check_document(c.Document(id="t", settings=settings, layers=made(("fine",))))
    with pytest.raises(Refusal) as caught:
        check_document(c.Document(id="t", settings=settings, layers=made(layers), deleted_layers=made(deleted)))
    assert caught.value.code == code
