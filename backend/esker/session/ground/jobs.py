"""Jobs: requests of rooms for the solver (DESIGN 8)."""

from __future__ import annotations

from dataclasses import dataclass, field

from esker import contract as c
from esker.document.revisions import revision
from esker.session.ground.ports import Base


@dataclass(frozen=True)
class Job:
    """One request for the solver: the strokes at a document's ``clock``, with revisions of what the ground follows
    from.

    heights_rev, channels_rev, paint_rev: those of the document (``StrokeSet``). layers_rev: of ``base``, the ground
    under the strokes; 0 without one. number: of two jobs the newer one has the greater number. A clock goes back where
    a commit fails; this number does not.
    """

    clock: int
    strokes: tuple[c.Stroke, ...]
    settings: c.TerrainSettings
    heights_rev: int = field(default_factory=revision)
    channels_rev: int = 0
    paint_rev: int = 0
    layers_rev: int = 0
    base: Base | None = field(default=None, compare=False)
    number: int = field(default_factory=revision)

    @property
    def heights(self) -> tuple[int, int]:
        """Revisions that the heights follow from: jobs of one room for which this is equal differ in other channels
        alone."""
        return self.heights_rev, self.layers_rev


@dataclass(frozen=True)
class Attempt:
    """A job that is to be done, or is being done. tries: how often it has failed for reasons of its own."""

    job: Job
    tries: int = 0
