"""Which patches stand for the ground of a view at a tolerance, and the indexes of them (paper 2, 4.2 and 5.1).

It may know ``patchwork.lod``.
"""
