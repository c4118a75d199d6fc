"""LOD space: which patches of all layers cover whom at which error (paper 2, section 3.3).

It may know ``patchwork.raster``.
"""
