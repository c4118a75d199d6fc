"""OpenGL without a window: the context, and what moderngl has no call for."""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable
from ctypes.util import find_library
from typing import Any, Final

import moderngl

log = logging.getLogger("esker.render")

GL_VERSION: Final = 430
EGL: Final = "libEGL.so.1"
_LOWER_LEFT, _ZERO_TO_ONE = 0x8CA1, 0x935F
_RENDERBUFFER, _DEPTH_32F = 0x8D41, 0x8CAC


class NoGraphics(RuntimeError):
    """There is no OpenGL that can draw here; the message is a sentence for people."""


def open_context() -> moderngl.Context:
    """A context of OpenGL 4.3 or later by EGL, with depth from 0 to 1 where that can be had. Raises NoGraphics."""
    try:
        # Where libGL is not installed: EGL's own library finds all functions too.
        how: dict[str, Any] = {"backend": "egl", "libgl": find_library("GL") or EGL}
        context = moderngl.create_context(require=GL_VERSION, standalone=True, **how)
    except Exception as error:  # what comes depends on the driver and on the libraries that are missing
        reason = str(error).strip().splitlines()[-1] if str(error).strip() else type(error).__name__
        raise NoGraphics(
            f"Pictures need OpenGL 4.3 by EGL, and there is none here ({reason}). "
            "On Debian: apt install libegl1 libgl1-mesa-dri."
        ) from error
    # An object that Python drops is freed when its own context is current: objects of two contexts have the same
    # numbers.
    context.gc_mode = "context_gc"
    return context


def half_depth(context: moderngl.Context) -> bool:
    """Makes clip space end at z = 0 and z = w, as in WebGPU. False where the driver cannot; then shaders convert."""
    if context.version_code < 450 and "GL_ARB_clip_control" not in context.extensions:
        return False
    call = _function("glClipControl", ctypes.c_uint, ctypes.c_uint)
    if call is None:
        return False
    call(_LOWER_LEFT, _ZERO_TO_ONE)
    return True


def depth_buffer(context: moderngl.Context, width: int, height: int, samples: int) -> moderngl.Renderbuffer:
    """Depth as 32-bit floats where that can be had: reversed depth has its precision from there."""
    made = context.depth_renderbuffer((width, height), samples=samples)
    bind = _function("glBindRenderbuffer", ctypes.c_uint, ctypes.c_uint)
    store = _function("glRenderbufferStorageMultisample", *(ctypes.c_uint,) * 3, *(ctypes.c_int,) * 2)
    if bind is not None and store is not None:
        bind(_RENDERBUFFER, made.glo)
        store(_RENDERBUFFER, samples, _DEPTH_32F, width, height)
        bind(_RENDERBUFFER, 0)
    return made


def _function(name: str, *takes: Any) -> Callable[..., None] | None:
    try:
        egl = ctypes.CDLL(EGL)
    except OSError:
        return None
    find = egl.eglGetProcAddress
    find.restype, find.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
    address = find(name.encode())
    return ctypes.CFUNCTYPE(None, *takes)(address) if address else None
