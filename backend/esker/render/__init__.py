"""The server's reference renderer: pictures of terrains by OpenGL, with real tessellation shaders (DESIGN 9).

The shaders are the browser's own: WGSL files of ``shaders/wgsl``, translated by the room ``wgsl``. Only this
room imports moderngl, and only when a picture is drawn. It may know every room that ranks below it.
"""
