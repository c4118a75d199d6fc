"""``esker doctor``: what this machine has that Esker needs, and one file for whoever wants to send figures.

It may know every room that ranks below it.
"""
