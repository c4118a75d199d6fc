"""Grids in a store of objects that servers share, with a real S3 server (SPEC J479 to J482)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bench.cluster._objects import KEYS, ObjectServer
from esker.patchwork.raster import rasters
from esker.store import grids as grids_module
from esker.store.engine import objects as objects_module
from esker.store.engine.objects import NoObjects, Objects
from esker.store.grids import FOLDER, TRASH_SECONDS, GridStore, MissingGrid
from esker.store.space import NoSpace


@pytest.fixture(scope="module")
def server() -> Iterator[ObjectServer]:
    made = ObjectServer()
    with made.environment():
        yield made
    made.close()


@pytest.fixture
def objects(server: ObjectServer, tmp_path: Path) -> Objects:
    """A prefix of its own."""
    return Objects(f"{server.url}/{tmp_path.name}")


def raster(value: float) -> rasters.Raster:
    return rasters.build(np.full((40, 40), value, np.float32))


def test_a_grid_that_one_server_stored_the_others_find(objects: Objects, tmp_path: Path) -> None:
    """SPEC J479: whole and verified, once; afterwards it is read from the disk."""
    made = raster(7.0)
    one, other = GridStore(tmp_path / "a", objects=objects), GridStore(tmp_path / "b", objects=objects)
    assert not other.has(made.digest)
    with pytest.raises(MissingGrid):
        other.read(made.digest)
    one.put(made)
    assert other.has(made.digest)
    assert other.size([made.digest]) > 0
    assert not (tmp_path / "b" / FOLDER / made.digest).exists()
    assert other.read(made.digest).heights[3, 3] == 7.0
    objects.delete(f"{FOLDER}/{made.digest}.tar")
    assert GridStore(tmp_path / "b", objects=objects).read(made.digest).digest == made.digest
    assert [path.name for path in (tmp_path / "b" / FOLDER).iterdir()] == [made.digest], "nothing half fetched is left"


def test_a_grid_is_stored_once_whoever_brings_it(objects: Objects, tmp_path: Path) -> None:
    """SPEC J479: a name is never overwritten but to make it young again."""
    first, second = tmp_path / "1", tmp_path / "2"
    first.write_bytes(b"first")
    second.write_bytes(b"second")
    objects.put("x", first)
    objects.put("x", second)
    objects._age = lambda _: None  # type: ignore[method-assign,assignment]  # as when two ask at once, and both find nothing
    objects.put("x", second)
    objects.get("x", tmp_path / "got")
    assert (tmp_path / "got").read_bytes() == b"first"


def test_a_large_file_goes_in_parts(objects: Objects, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J479."""
    monkeypatch.setattr(objects_module, "AT_ONCE_BYTES", 1 << 20)
    large = tmp_path / "large"
    large.write_bytes(bytes(range(256)) * (48 << 10))
    objects.put("large", large)
    objects.get("large", tmp_path / "got")
    assert (tmp_path / "got").read_bytes() == large.read_bytes()
    assert objects.size("large") == large.stat().st_size


def test_another_grid_under_its_name_is_refused(objects: Objects, tmp_path: Path) -> None:
    """SPEC J480."""
    one, other = GridStore(tmp_path / "a", objects=objects), GridStore(tmp_path / "b", objects=objects)
    right, wrong = raster(1.0), raster(2.0)
    one.put(wrong)
    objects.get(f"{FOLDER}/{wrong.digest}.tar", tmp_path / "wrong.tar")
    objects.put(f"{FOLDER}/{right.digest}.tar", tmp_path / "wrong.tar")
    with pytest.raises(MissingGrid):
        other.read(right.digest)
    assert list((tmp_path / "b" / FOLDER).iterdir()) == []


def test_what_no_terrain_names_goes_by_its_age(
    objects: Objects, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SPEC J481: never by what one server remembers."""
    store = GridStore(tmp_path, objects=objects)
    named, forgotten = raster(1.0), raster(2.0)
    for each in (named, forgotten):
        store.put(each)
    store.throw_old_objects({named.digest})
    assert objects.has(f"{FOLDER}/{forgotten.digest}.tar"), "it is young"
    monkeypatch.setattr(grids_module, "TRASH_SECONDS", -TRASH_SECONDS)
    store.throw_old_objects({named.digest})
    assert not objects.has(f"{FOLDER}/{forgotten.digest}.tar")
    assert objects.has(f"{FOLDER}/{named.digest}.tar")


def test_while_the_store_is_gone_what_is_here_serves(server: ObjectServer, tmp_path: Path) -> None:
    """SPEC J482: what is not here is missing for now, nothing new is laid, and afterwards all goes on."""
    objects = Objects(f"{server.url}/{tmp_path.name}")
    store, far = GridStore(tmp_path / "a", objects=objects), GridStore(tmp_path / "b", objects=objects)
    here, new = raster(1.0), raster(2.0)
    store.put(here)
    server.stop()
    try:
        assert store.read(here.digest).heights[0, 0] == 1.0
        with pytest.raises(MissingGrid):
            far.read(here.digest)
        with pytest.raises(NoObjects) as failure:
            store.put(new)
        told = str(failure.value)
        assert not any(key in told for key in KEYS.values())
        assert not (tmp_path / "a" / FOLDER / new.digest).exists(), "an op must not name it yet"
    finally:
        server.start()
    store.put(new)
    assert far.read(new.digest).heights[0, 0] == 2.0


def test_a_full_cache_makes_room(objects: Objects, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J482: what nobody has open, and nobody has used for longest, goes."""
    store = GridStore(tmp_path, objects=objects)
    kept, gone = raster(1.0), raster(2.0)
    for each in (kept, gone):
        store.put(each)
    held = store.read(kept.digest)

    def need(more: int = 0, *, drawing: bool = False) -> None:
        if more and store.path(gone.digest).exists():
            raise NoSpace("full")

    monkeypatch.setattr(store.space, "need", need)
    wanted = raster(3.0)
    GridStore(tmp_path / "other", objects=objects).put(wanted)
    assert store.read(wanted.digest).heights[0, 0] == 3.0
    assert held.digest == kept.digest
    assert sorted(p.name for p in (tmp_path / FOLDER).iterdir()) == sorted([kept.digest, wanted.digest])
    monkeypatch.undo()
    assert store.read(gone.digest).heights[0, 0] == 2.0


def test_addresses_that_are_none_are_refused() -> None:
    """SPEC J474."""
    for wrong in ("http://somewhere", "s3://", "bucket"):
        with pytest.raises(NoObjects, match="ESKER_BLOBS must name a bucket"):
            Objects(wrong)
