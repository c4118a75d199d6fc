"""Solved levels into what clients hold: integers, versions, selection by view, frames and their bytes.

``delivery`` is its front: a server of tiles for each room, and what each client holds of them. It may know
``compiled``, ``contract`` and ``grid``."""
