"""The workspaces of a solver: who solves with which, which have device memory, and when they go.

It knows `solve/opencl` and the passes of a solve; only the solver itself knows it.
"""
