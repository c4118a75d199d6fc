"""Lessons: who conducts, who may draw, who is sent out, and under which names people see each other.

It may know ``contract``. No I/O and no time: ``session/room/`` asks it and carries out what it says (DESIGN 19).
"""
