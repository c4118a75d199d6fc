"""What a terrain is: strokes, layers, operations that change them, undo and the activity log, as pure functions.

Nothing here does I/O or keeps state; ``archive`` alone reads and writes files that it is given. It may know
``contract``, ``errors`` and ``grid``.
"""
