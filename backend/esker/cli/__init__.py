"""The commands of ``esker``, one file each; ``main`` lists them.

It may know every room that ranks below it.
"""
