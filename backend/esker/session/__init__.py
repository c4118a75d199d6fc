"""Open terrains: ``room/`` has people and ops, ``ground/`` the solver's time.

``room`` knows ``ground``, which does not know it; no OpenCL here, and no HTTP. It may know ``contract``, ``document``,
``errors``, ``events``, ``grid``, ``fairness``, ``process``, ``store``, ``tasks``, ``tiles`` and ``version``.
"""
