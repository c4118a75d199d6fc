"""Elevation layers of a live terrain from Python: the half of ``LiveTerrain`` that goes over HTTP."""

from __future__ import annotations

import io
import ssl
import tempfile
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from esker import contract as c
from esker.api import arguments
from esker.api.http import Api
from esker.api.link import Refused
from esker.api.uploads import Uploads
from esker.document.sync import SyncDoc
from esker.patchwork.raster import rasters
from esker.patchwork.raster.rasters import Raster

GRID_SECONDS: Final = 120.0
"""A large grid may take so long to be packed before its first byte comes."""
ARRIVES_SECONDS: Final = 15.0
"""Time for the op of a finished import to come over the socket."""
ARRAY_ANSWERS: Final[Mapping[str, str]] = {"rows": "south first", "nodata": "none"}
"""Answers that hold of arrays: row 0 is in the south, and what is no data is NaN."""


class Grids:
    """The stored grids of one terrain on a server, fetched once each."""

    def __init__(self, link: str, tls: ssl.SSLContext | None) -> None:
        self._api = Api(link, tls, timeout=GRID_SECONDS)
        self._rasters: dict[str, Raster] = {}

    def of(self, layers: Iterable[c.Layer]) -> dict[str, Raster]:
        """The grids of these layers by ``Layer.content``. Raises Refused, OSError."""
        wanted = {layer.content for layer in layers}
        for digest in wanted - self._rasters.keys():
            self._rasters[digest] = self._fetch(digest)
        return {digest: self._rasters[digest] for digest in wanted}

    def _fetch(self, digest: str) -> Raster:
        data = self._api.request("GET", f"grids/{digest}")
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            raster = rasters.build(arrays["heights"], arrays.get("warp"))
        if raster.digest != digest:
            raise Refused("no_grid", "The server gave another elevation grid than was asked for.")
        return raster


class LiveLayers(ABC):
    """The methods of ``LiveTerrain`` for elevation layers."""

    _address: str
    _ca_file: Path | None
    _client: str
    _grids: Grids
    _sync: SyncDoc
    _changed: threading.Condition

    @abstractmethod
    def _submit(self, op: c.Op, gesture: str | None = None) -> None: ...

    @abstractmethod
    def _await(self, ready: Callable[[], bool], timeout: float, what: str) -> None: ...

    @property
    def layers(self) -> tuple[c.Layer, ...]:
        """The elevation layers as seen from here, oldest first."""
        with self._changed:
            return tuple(self._sync.document.layers.values())

    @property
    def grids(self) -> dict[str, Raster]:
        """The grids of the layers by ``Layer.content``, fetched once each. Raises Refused, OSError."""
        return self._grids.of(self.layers)

    def add_grid(
        self,
        grid: ArrayLike | str | Path,
        anchor: tuple[float, float] | None = None,
        rotation: float | None = None,
        spacing: float | tuple[float, float] | None = None,
        accuracy: float | None = None,
        priority: int | None = None,
        name: str | None = None,
        *,
        scale: float | None = None,
        lift: float | None = None,
        source: str | None = None,
        licence: str | None = None,
        answers: Mapping[str, str] | None = None,
        on_status: Callable[[c.ImportStatus], None] = lambda _: None,
    ) -> str:
        """Lays an elevation grid on the terrain, for everybody; returns the layer's id. An undo step of ours.

        As ``Terrain.add_grid``, done by the server: ``on_status`` hears how far the import is. Raises Refused,
        ValueError for what is no grid, OSError, TimeoutError.
        """
        fields = {
            "anchor": None if anchor is None else arguments.pair("anchor", anchor),
            "rotation_deg": None if rotation is None else arguments.number("rotation", rotation),
            "spacing_m": None if spacing is None else steps(spacing),
            "accuracy_m": None if accuracy is None else arguments.number("accuracy", accuracy, 0.0),
            "name": name,
            "scale": None if scale is None else arguments.number("scale", scale),
            "lift_m": None if lift is None else arguments.number("lift", lift),
            "source": source,
            "licence": licence,
        }
        rank = None if priority is None else arguments.whole("priority", priority, -(10**6), 10**6)
        arguments.called("on_status", on_status)
        said = arguments.texts("answers", answers)
        arguments.model(c.ImportAnswers, {"answers": said, **fields})  # before anything is sent
        with Uploads(self._address, self._ca_file) as uploads:
            layer = bring_in(uploads, grid, fields, said, on_status, self._client)
        self._await(lambda: layer in self._sync.confirmed.layers, ARRIVES_SECONDS, "the new layer did not come")
        if rank is not None:
            self.set_grid(layer, priority=rank)
        return layer

    def remove_grid(self, layer_id: str) -> None:
        """Takes a layer away. Raises Refused."""
        self._submit(arguments.model(c.DeleteLayer, {"layer": layer_id}))

    def restore_grid(self, layer_id: str) -> None:
        """Brings a deleted layer back. Raises Refused."""
        self._submit(arguments.model(c.RestoreLayer, {"layer": layer_id}))

    def set_grid(self, layer_id: str, **fields: Any) -> None:
        """Moves, turns, weighs, hides or renames a layer: fields of ``contract.LayerFields``. Raises Refused,
        ValueError."""
        self._submit(arguments.model(c.SetLayer, {"layer": layer_id, "fields": arguments.model(c.LayerFields, fields)}))


def bring_in(
    uploads: Uploads,
    grid: ArrayLike | str | Path,
    fields: Mapping[str, Any],
    answers: Mapping[str, str],
    on_status: Callable[[c.ImportStatus], None],
    client: str,
) -> str:
    """Uploads a file or an array and follows its import to the end; returns the id of the layer.

    ``client``: in whose name. ``fields``: of ``contract.ImportAnswers``, where they are not None. Raises Refused (with
    the server's sentence, or with what it asks and nobody answered), ValueError for what is no grid, OSError,
    http.client.HTTPException.
    """
    given = {name: value for name, value in fields.items() if value is not None}
    if isinstance(grid, str | Path):
        return _follow(uploads, arguments.path("grid", grid), given, answers, on_status, client)
    array = rasters.numbers(grid)
    if "spacing_m" not in given:
        raise ValueError("an array does not say how far its samples are apart: give spacing=metres or (sX, sY)")
    with tempfile.TemporaryDirectory(prefix="esker-grid-") as folder:
        path = Path(folder) / "array.npy"
        np.save(path, array, allow_pickle=False)
        return _follow(uploads, path, given, {**ARRAY_ANSWERS, **answers}, on_status, client, always=True)


def _follow(
    uploads: Uploads,
    path: Path,
    given: Mapping[str, Any],
    answers: Mapping[str, str],
    on_status: Callable[[c.ImportStatus], None],
    client: str,
    always: bool = False,
) -> str:
    """``always``: what the answers leave open is taken as the server proposes."""
    query = f"&client={client}" + ("&hold=true" if given or answers else "")
    status = uploads.follow(uploads.send(path, lambda _: None, query), on_status)
    if status.stage == "question":
        asked = status.report.questions if status.report is not None else ()
        by_hand = {"size", "place"} if "spacing_m" in given else {"place"} if "anchor" in given else set()
        found = {q.id: answers.get(q.id, q.default) for q in asked if always or q.id in answers or q.id in by_hand}
        open_ones = [question for question in asked if question.id not in found]
        if open_ones:
            uploads.cancel(status)
            hints = " ".join(f"{q.text} (answers={{{q.id!r}: {q.default!r}}}, for instance)" for q in open_ones)
            raise Refused("question", f"{path.name} leaves something open. {hints}")
        status = uploads.follow(uploads.answer(status, c.ImportAnswers(answers=found, **given)), on_status)
    if status.layer is None:
        raise Refused(status.stage, status.text or "The server did not take this file.")
    return status.layer


def steps(spacing: float | tuple[float, float]) -> tuple[float, float]:
    """(sX, sY) of one number or two. Raises ValueError."""
    found = arguments.real_array("spacing", spacing)
    if found.shape not in {(), (2,)}:
        raise ValueError("spacing is one number or two: (sX, sY)")
    x, y = np.broadcast_to(found, 2).tolist()
    return x, y
