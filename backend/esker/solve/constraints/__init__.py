"""Strokes into constraints: tables, bins, and what each sample is asked for (DESIGN 5.2, 5.5).

It may know ``solve.base``, and no device.
"""
