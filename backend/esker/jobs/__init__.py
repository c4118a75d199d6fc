"""Bringing elevation files into terrains: upload, examination, questions, conversion, and the op that lays the layer.

One import is one work folder of the ``GridStore`` and one task. Everything about the file happens in a child process
(``esker.importing``); here is who may import, how much at once, and in which order things become durable: the raster
is stored under its digest, synced, and only then is the op ordered that names it (decision 0019). It may know every
room that ranks below it.
"""

from __future__ import annotations

from esker.jobs.imports import Imports as Imports
