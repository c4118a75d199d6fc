"""Every shader module is valid for wgpu's compiler (naga, Firefox) too, not only for Chromium's (SPEC R17)."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.gpu.device import SHADERS, open_device

FRONTEND = Path(__file__).resolve().parents[2] / "frontend" / "src" / "gpu"


def modules() -> dict[str, list[Path]]:
    """Files of each module, read from gpu/shaders.ts itself."""
    text = (FRONTEND / "shaders.ts").read_text()
    files = dict(re.findall(r'import (\w+) from "@shaders/([\w/.]+)\?raw"', text))
    common = re.search(r"const common = join\(([^)]*)\)", text)
    assert common is not None
    shared = [name.strip() for name in common.group(1).split(",")]
    found: dict[str, list[Path]] = {}
    for name, parts in re.findall(r"^  (\w+): join\(([^)]*)\)", text, re.M):
        expanded = [
            file for part in parts.split(",") for file in (shared if part.strip() == "common" else [part.strip()])
        ]
        found[name] = [SHADERS / files[part] for part in expanded]
    assert len(found) >= 8
    return {**found, "blit": [SHADERS / "wgsl" / "blit.wgsl"]}


@pytest.mark.parametrize("name", sorted(modules()))
def test_module_is_valid(name: str) -> None:
    code = "\n".join(path.read_text() for path in modules()[name])
    open_device().create_shader_module(code=code)
