"""Classes: a copy of a terrain for everyone, the wall on which all copies are seen, and collecting them.

It may know every room that ranks below it.
"""
