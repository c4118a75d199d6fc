"""WGSL into GLSL: reads the subset of WGSL that Esker's shaders use, types it, and writes GLSL 4.30.

The room owns the translation alone; it knows no other room, no file and no device.
"""
