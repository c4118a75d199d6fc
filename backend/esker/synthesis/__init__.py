"""The detail that grows on solved ground: the server's twin of the page's fractal, in NumPy and OpenCL.

It may know ``compiled``, ``contract``, ``flow``, ``grid`` and ``resources``.
"""
