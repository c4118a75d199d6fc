"""Tasks of a lesson: ground as a target, and how far a terrain is with what is asked of it.

Pure functions of settled heights; no float that a page computes decides a score. It may know ``contract``,
``errors`` and ``flow``. docs/tasks.md says how points are counted.
"""
