"""Every shader module is valid for wgpu's compiler (naga, Firefox) too, not only for Chromium's (SPEC R17)."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.gpu.device import SHADERS, open_device

FRONTEND = Path(__file__).resolve().parents[2] / "frontend" / "src" / "gpu"


def modules() -> dict[str, list[Path]]:
    """Files of each module in every variant, read from gpu/shaders.ts itself."""
    text = (FRONTEND / "shaders.ts").read_text()
    files = {name: [SHADERS / path] for name, path in re.findall(r'import (\w+) from "@shaders/([\w/.]+)\?raw"', text)}
    common = re.search(r"const common = join\(([^)]*)\)", text)
    assert common is not None
    files["common"] = [file for name in common.group(1).split(",") for file in files[name.strip()]]

    def joined(parts: str, **variants: str) -> list[Path]:
        names = [variants.get(part.strip(), part.strip()) for part in parts.split(",") if part.strip()]
        return [file for name in names for file in files[name]]

    found: dict[str, list[Path]] = {"blit": [SHADERS / "wgsl" / "blit.wgsl"]}
    for parts in re.findall(r"join\(((?:[^()]|\[\w+\])*)\)", text.split("export type Detail")[1]):
        for detail in ("detailRich", "detailPlain"):
            for look in ("lookNatural", "lookAlpine", "lookDesert", "lookPaper"):
                for rule in ("ruleLandscape", "ruleSmooth", "rulePlain"):
                    stones = detail.replace("detail", "stones")
                    variant = {"DETAILS[detail]": detail, "STONES[detail]": stones}
                    variant |= {"LOOKS[look]": look, "RULES[rule]": rule}
                    chosen = joined(parts, **variant)
                    names = [name for place, name in variant.items() if place in parts]
                    found["-".join([chosen[-1].stem, *names])] = chosen
    assert len(found) == 1 + 8 + 4 + 15 + 3
    return found


@pytest.mark.parametrize("name", sorted(modules()))
def test_module_is_valid(name: str) -> None:
    code = "\n".join(path.read_text() for path in modules()[name])
    open_device().create_shader_module(code=code)
