"""Blending of patches: f = sum P W / sum W (paper 2, section 3.2), in compiled loops and on a device.

It may know ``patchwork.lod``.
"""
