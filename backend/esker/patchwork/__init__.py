"""Elevation grids of any spacing and orientation as a living patchwork (DESIGN 11; paper 2, "Patchwork Terrains").

It may know ``compiled``, ``contract``, ``grid``, ``process`` and ``resources``.
"""
