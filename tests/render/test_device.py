"""The context that pictures are drawn in (SPEC H8, V6)."""

from __future__ import annotations

from typing import Any

import moderngl
import pytest

from esker.render import device


def test_pictures_need_no_libgl(monkeypatch: pytest.MonkeyPatch) -> None:
    """Debian's packages of EGL and of its drivers, which the message and the container name, do not bring libGL."""
    asked: dict[str, Any] = {}
    create = moderngl.create_context

    def spied(**how: Any) -> moderngl.Context:
        asked.update(how)
        return create(**how)

    monkeypatch.setattr(device, "find_library", lambda _: None)
    monkeypatch.setattr(moderngl, "create_context", spied)
    context = device.open_context()
    assert asked["libgl"] == "libEGL.so.1"
    frame = context.simple_framebuffer((2, 2))
    frame.clear(0.0, 1.0, 0.0, 1.0)
    assert frame.read() == bytes([0, 255, 0] * 4)
    context.release()
