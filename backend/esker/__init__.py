"""Esker: sketch one landscape together. ``from esker import Terrain, Stroke, connect``."""
