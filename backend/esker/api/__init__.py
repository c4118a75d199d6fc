"""The Python face: ``Terrain``, ``Stroke`` and ``connect``, and what they ask of a server by HTTP.

It may know every room that ranks below it.
"""
