"""Where a file lies on a terrain: its coordinates, and the anchor, rotation and steps that fit them best.

It may know ``importing``.
"""
