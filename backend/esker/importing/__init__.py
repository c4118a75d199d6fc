"""Elevation files: what they are, what they leave open, and how they become grids (docs/importing.md).

The only room with rasterio and pyproj. Files are read in a child process with bounds (``run``); ``python -m
esker.importing`` is that process. It may know ``contract``, ``patchwork`` and ``process``.
"""
