"""How a terrain leaves for game engines, modellers and GIS: heightmaps, grids, meshes and masks (docs/exporting.md).

``ground`` takes the ground and ``formats`` writes it, for ``Terrain.export`` and ``esker export``; on a server ``run``
has both done by a process of its own (``api.export_child``), for ``jobs.exports``, which keeps those of all terrains.
It may know every room that ranks below it.
"""
