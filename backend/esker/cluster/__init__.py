"""Several servers over one database: who has which terrain, how others reach it there, and how it moves.

A server without ``--node`` uses nothing of it (DESIGN 18). It may know ``contract``, ``errors`` and ``store``.
"""
