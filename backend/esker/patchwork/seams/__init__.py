"""Seams between surveys: where two layers disagree along a border, the older one is bent to meet the newer (DESIGN 11).

It may know ``patchwork.blend``.
"""
