"""Strokes into heights: constraints, multigrid, refinement, and the OpenCL devices or NumPy that compute them.

Workspaces on a device are its only state, and can be made again. It may know ``contract``, ``document``, ``events``,
``grid``, ``process``, ``resources`` and ``synthesis``.
"""
