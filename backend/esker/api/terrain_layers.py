"""Elevation grids of a terrain without a server: what is laid, and the ground that the grids make (DESIGN 11)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esker.api import arguments
from esker.api.layers import Patchwork, Sample, imported, laid
from esker.contract import Layer, TerrainSettings
from esker.patchwork.lod.precedence import default_priority
from esker.patchwork.raster.rasters import Raster


class TerrainLayers:
    """The part of ``Terrain`` that elevation layers are laid with. ``LiveLayers`` is that of a live terrain."""

    _settings: TerrainSettings
    _patchwork: Patchwork

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The elevation layers, oldest first."""
        return self._patchwork.layers

    @property
    def grids(self) -> Mapping[str, Raster]:
        """The grids of the layers, by ``Layer.content``."""
        return self._patchwork.grids

    def add_grid(
        self,
        grid: ArrayLike | str | Path,
        anchor: tuple[float, float] | None = None,
        rotation: float | None = None,
        spacing: float | tuple[float, float] | None = None,
        accuracy: float | None = None,
        priority: int | None = None,
        name: str = "",
        *,
        scale: float = 1.0,
        lift: float = 0.0,
        source: str = "",
        licence: str = "",
        answers: Mapping[str, str] | None = None,
    ) -> str:
        """Lays an elevation grid on the terrain; returns the layer's id. Nothing is resampled, nothing is rebuilt.

        Parameters
        ----------
        grid: heights (rows, cols), NaN or masked where there are none, row 0 south; or the path of a file
            (docs/importing.md), whose own place counts where it has one.
        anchor: world position of sample [0, 0], metres; by default the grid lies in the middle.
        rotation: degrees counter-clockwise.
        spacing: metres between samples, or (sX, sY).
        accuracy: the largest error of the grid anywhere, metres; by default it follows from the spacing.
        priority: of layers that disagree the greater is believed; by default the one added last, unless it is coarser
            and less accurate than what it lies on.
        scale, lift: height = ``scale`` * sample + ``lift``, metres.
        answers: to what a file leaves open.

        Raises
        ------
        ValueError: the grid cannot be laid, or the file is refused or leaves something open.
        OSError: the file cannot be read.

        Examples
        --------
        >>> import numpy as np
        >>> from esker import Terrain
        >>> t = Terrain(size_m=1000)
        >>> table = t.add_grid(np.full((11, 11), 50.0), anchor=(250, 250), spacing=50, name="table")
        >>> [layer.name for layer in t.layers], t.sample([(500, 500)])
        (['table'], array([50.]))
        """
        more: dict[str, Any] = {
            "name": name, "source": source, "licence": licence,
            "scale": arguments.number("scale", scale), "lift_m": arguments.number("lift", lift),
        }  # fmt: skip
        said = arguments.texts("answers", answers)
        rank = 0 if priority is None else arguments.whole("priority", priority, -(10**6), 10**6)
        rotation = None if rotation is None else arguments.number("rotation", rotation)
        accuracy = None if accuracy is None else arguments.number("accuracy", accuracy, 0.0)
        if isinstance(grid, (str, Path)):
            layer, raster, place = imported(
                Path(grid), self._settings, anchor=anchor, rotation=rotation, spacing=spacing, accuracy=accuracy,
                priority=rank, answers=said, more=more,
            )  # fmt: skip
            if self._settings.place is None and place is not None:
                self._settings = self._settings.model_copy(update={"place": place})
        else:
            layer, raster = laid(
                grid, self._settings.size_m, anchor=anchor, rotation=rotation, spacing=spacing, accuracy=accuracy,
                priority=rank, more=more,
            )  # fmt: skip
        if priority is None:
            layer = layer.model_copy(update={"priority": default_priority(layer, self.layers)})
        self._patchwork.put(layer, raster)
        return layer.id

    def set_grid(self, layer_id: str, **fields: Any) -> Layer:
        """Move, turn, re-weight, hide or rename a layer: fields of ``contract.LayerFields``.

        Raises KeyError, ValueError.
        """
        return self._patchwork.change(layer_id, fields)

    def remove_grid(self, layer_id: str) -> None:
        """Take a layer away. Raises KeyError when there is none of this id."""
        self._patchwork.remove(layer_id)

    def sample(
        self, points: ArrayLike, tolerance: float = 0.0, derivatives: bool = False
    ) -> NDArray[np.float64] | Sample:
        """The ground of the elevation layers at some places, without strokes; 0 where no layer is.

        Parameters
        ----------
        points: places (n, 2), world metres.
        tolerance: the error that may be made, metres; 0 gives the data.
        derivatives: whether gradient and curvature of the same, twice differentiable surface are wanted too.

        Returns
        -------
        Heights (n,) float64, metres; with ``derivatives`` a ``Sample``.

        Raises
        ------
        ValueError: the points are not finite (n, 2).

        Examples
        --------
        >>> import numpy as np
        >>> from esker import Terrain
        >>> t = Terrain(size_m=1000)
        >>> slope = t.add_grid(np.tile(np.arange(11.0), (11, 1)), anchor=(0, 0), spacing=100)
        >>> found = t.sample([(500, 500)], derivatives=True)
        >>> found.heights.round(3), found.slope_deg.round(2)
        (array([5.]), array([0.57]))
        """
        places = arguments.points("points", points, (2,))
        tolerance = arguments.number("tolerance", tolerance, 0.0)
        derivatives = arguments.flag("derivatives", derivatives)
        base, n = self._patchwork.base, len(places)
        if base is None:
            return Sample(np.zeros(n), np.zeros((n, 2)), np.zeros((n, 3))) if derivatives else np.zeros(n)
        found = base.sample(places, tolerance=tolerance, smooth=True, derivatives=derivatives)
        if found.gradient is None or found.hessian is None:
            return found.heights
        return Sample(found.heights, found.gradient, found.hessian)
