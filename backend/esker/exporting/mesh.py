"""The ground as a mesh: binary glTF 2.0 (Khronos Group, "glTF 2.0 Specification", 2021; ISO/IEC 12113:2022)."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from esker import contract
from esker.exporting.colours import colours
from esker.exporting.ground import Ground
from esker.version import VERSION

MAGIC: Final = 0x46546C67
JSON_CHUNK: Final = 0x4E4F534A
BIN_CHUNK: Final = 0x004E4942
FLOAT, UINT32 = 5126, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP = 9729, 9987, 33071
ROUGHNESS: Final = 0.95


def vertices(ground: Ground) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Positions (n, 3), normals (n, 3) and texture coordinates (n, 2) of all samples, row 0 south first.

    glTF is right-handed with y up: x east, y the height, z south, metres; the middle of the ground lies over the
    origin, so that a modeller finds it, and heights are as they are. Normals are those of central differences.
    """
    rows, columns = ground.heights.shape
    s = ground.spacing_m
    across = (np.arange(columns) - 0.5 * (columns - 1)) * s
    along = (0.5 * (rows - 1) - np.arange(rows)) * s
    position = np.empty((rows, columns, 3), dtype=np.float32)
    position[..., 0], position[..., 1], position[..., 2] = across[None, :], ground.heights, along[:, None]
    north, east = np.gradient(ground.heights.astype(np.float64), s)
    normal = np.stack([-east, np.ones_like(east), north], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    uv = np.empty((rows, columns, 2), dtype=np.float32)
    uv[..., 0] = np.linspace(0.0, 1.0, columns)[None, :]
    uv[..., 1] = np.linspace(1.0, 0.0, rows)[:, None]  # a picture begins in the north
    return position.reshape(-1, 3), normal.reshape(-1, 3).astype(np.float32), uv.reshape(-1, 2)


def triangles(rows: int, columns: int) -> NDArray[np.uint32]:
    """(m,) corners of two triangles a cell, anticlockwise seen from above; the diagonal runs from south-west to
    north-east."""
    at = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    sw, se, nw, ne = at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]
    return np.stack([sw, se, ne, sw, ne, nw], axis=-1).reshape(-1)


def write_glb(path: Path, ground: Ground) -> None:
    """One mesh of triangles with the colours of its covers, or plain where it has none, as one .glb file.

    Raises ValueError beyond EXPORT_MESH_SAMPLES a side, OSError."""
    rows, columns = ground.heights.shape
    if max(rows, columns) > contract.EXPORT_MESH_SAMPLES or min(rows, columns) < 2:
        most = contract.EXPORT_MESH_SAMPLES
        raise ValueError(f"a mesh has 2 to {most} samples a side, not {columns} x {rows}: take a coarser level")
    made = _Buffer()
    position, normal, uv = vertices(ground)
    attributes = {
        "POSITION": made.accessor(position, "VEC3", FLOAT, ARRAY_BUFFER, bounds=True),
        "NORMAL": made.accessor(normal, "VEC3", FLOAT, ARRAY_BUFFER),
        "TEXCOORD_0": made.accessor(uv, "VEC2", FLOAT, ARRAY_BUFFER),
    }
    indices = made.accessor(triangles(rows, columns), "SCALAR", UINT32, ELEMENT_ARRAY_BUFFER)
    title = ground.settings.title or "Terrain"
    surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": ROUGHNESS}
    more: dict[str, Any] = {}
    if ground.masks:
        surface["baseColorTexture"] = {"index": 0}
        more = {
            "images": [{"name": "colours", "mimeType": "image/png", "bufferView": made.view(_picture(ground))}],
            "samplers": [{"magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR, "wrapS": CLAMP, "wrapT": CLAMP}],
            "textures": [{"source": 0, "sampler": 0}],
        }
    else:
        surface["baseColorFactor"] = [0.35, 0.33, 0.3, 1.0]
    document = {
        "asset": {"version": "2.0", "generator": f"Esker {VERSION}"},
        "scene": 0,
        "scenes": [{"name": title, "nodes": [0]}],
        "nodes": [{"name": title, "mesh": 0, "extras": ground.facts()}],
        "meshes": [{"name": title, "primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}],
        "materials": [{"name": "ground", "pbrMetallicRoughness": surface}],
        **more,
        "accessors": made.accessors,
        "bufferViews": made.views,
        "buffers": [{"byteLength": made.size}],
    }
    _write(path, json.dumps(document, separators=(",", ":")).encode(), made)


def _picture(ground: Ground) -> bytes:
    out = io.BytesIO()
    Image.fromarray(colours(ground)[::-1]).save(out, format="PNG", compress_level=4)
    return out.getvalue()


class _Buffer:
    """The binary chunk in the making: views begin at multiples of four bytes."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.size = 0

    def view(self, data: bytes, target: int | None = None) -> int:
        """A view of bytes; returns its number."""
        seen = {"buffer": 0, "byteOffset": self.size, "byteLength": len(data)}
        self.views.append(seen if target is None else seen | {"target": target})
        pad = -len(data) % 4
        self.parts += [data, bytes(pad)]
        self.size += len(data) + pad
        return len(self.views) - 1

    def accessor(self, values: NDArray[Any], kind: str, component: int, target: int, *, bounds: bool = False) -> int:
        """An accessor of an array of its own; returns its number."""
        plain = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        made: dict[str, Any] = {
            "bufferView": self.view(plain.tobytes(), target),
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        if bounds:
            made |= {"min": plain.min(axis=0).tolist(), "max": plain.max(axis=0).tolist()}
        self.accessors.append(made)
        return len(self.accessors) - 1


def _write(path: Path, text: bytes, made: _Buffer) -> None:
    text += b" " * (-len(text) % 4)
    with path.open("wb") as file:
        file.write(struct.pack("<III", MAGIC, 2, 12 + 8 + len(text) + 8 + made.size))
        file.write(struct.pack("<II", len(text), JSON_CHUNK) + text)
        file.write(struct.pack("<II", made.size, BIN_CHUNK))
        for part in made.parts:
            file.write(part)
