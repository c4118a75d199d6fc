"""Readers of elevation files, one for each kind of format.

A reader knows ``importing.source`` and no placement.
"""
