"""Refinement above the global levels, tile by tile (DESIGN 5.6).

It may know ``solve``, its constraints and its devices.
"""
