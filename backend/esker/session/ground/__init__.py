"""The solver's time: from a room's newest job to tiles and frames.

``worker`` alone calls the solver, which is handed in: no OpenCL here, and nothing of people, whose connections are
``ports.FrameOutlet``. It may know ``contract``, ``document``, ``grid``, ``process``, ``store`` and ``tiles``.
"""
