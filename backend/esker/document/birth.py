"""How a terrain is born: empty, by the newest edition of the rules of its ground, with rivers and gullies."""

from __future__ import annotations

from esker import contract as c


def new_document(size_m: float = c.DEFAULT_SIZE_M) -> c.Document:
    """A terrain without strokes, under the id "new". ``size_m``: metres a side.

    >>> new_document(1024.0).settings.edition == c.CURRENT_EDITION
    True
    """
    reach_m = size_m * c.DEFAULT_REACH_FRACTION
    born = {"size_m": size_m, "edition": c.CURRENT_EDITION, "reach_m": reach_m, "rivers": c.DEFAULT_RIVERS}
    worn = {"erosion": c.BORN_EROSION, "hold": c.BORN_HOLD}
    return c.Document(id="new", settings=c.TerrainSettings.model_validate(born | worn))
