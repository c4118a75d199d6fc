"""The reference renderer: one picture of a scene, by tessellation and the page's own shaders (DESIGN 9)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from esker.contract import NO_LAKE, PATCH_CELLS, SUBPATCHES, TerrainSettings
from esker.render import sources
from esker.render.atlas import MAX_SLOTS, PLAIN_MARCH, Atlas
from esker.render.camera import eye_projection, part
from esker.render.device import depth_buffer, half_depth, open_context
from esker.render.frame import Detail, Rect, Scene, base_height, sun_direction, view_values
from esker.render.instances import Instances
from esker.render.layout import StructLayout
from esker.render.programs import Compute, Draw, Resources
from esker.render.rivers import river_map
from esker.render.select import Cut, choose, frustum
from esker.render.surface import Surface
from esker.render.tables import noise_mipmaps, stone_mipmaps
from esker.synthesis.lakes import Lakes, Surfaces, lake_texture, levels_on, waves_of

Pixels = NDArray[np.uint8]

LARGEST_PART: Final = 2048
"""Pixels along a side that are drawn at once; larger pictures are put together."""
SAMPLES: Final = 4
ANISOTROPY: Final = 8.0
NO_ANISOTROPY: Final = ("llvmpipe", "softpipe")
"""Mesa's software drivers do not come back from anisotropic look-ups in multisampled passes (seen with Mesa 22.3)."""
COARSER: Final = 1.25
"""Factor on the screen error while a picture would need more tiles than the atlas holds."""


class Channels(NamedTuple):
    """What strokes ask of the detail: (n, n) grids over the domain. ``amplitude``: metres; ``roughness``: 0..1."""

    amplitude: NDArray[np.float32]
    roughness: NDArray[np.float32]


PLAIN_CHANNELS: Final = Channels(np.zeros((2, 2), dtype=np.float32), np.full((2, 2), 0.5, dtype=np.float32))


@dataclass(frozen=True)
class Picture:
    """``pixels``: (height, width, 3), row 0 above. ``tau_px``: the screen error that was kept; ``patches``: drawn."""

    pixels: Pixels
    tau_px: float
    patches: int


class Reference:
    """Draws pictures one after the other. Not for several threads: a context belongs to the one that made it."""

    def __init__(
        self, detail: Detail = "rich", *, factor: int = 1, clear: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> None:
        """``detail``: "plain" draws what the page draws on adapters that are no GPU. ``factor``: segments a cell, 1 to
        4; with more, how a driver cuts a cell in two matters less. ``clear``: what shows where nothing is drawn. Raises
        device.NoGraphics."""
        self.context = open_context()
        self._half_depth = half_depth(self.context)
        self._detail: Detail = detail
        self._clear = clear
        self._factor = factor
        march = PLAIN_MARCH if detail == "plain" else {}
        self._normals = Compute(self.context, sources.normals(), "compute_normals")
        self._sun = Compute(self.context, sources.sun(), "compute_sun", march)
        self._sky = [Compute(self.context, sources.sky(), entry) for entry in ("bake_sky", "bake_ambient")]
        self._draws: dict[tuple[str, str], Draw] = {}
        self._fixed = self._samplers()
        self._instances: Instances | None = None
        self._noise, self._stones = (self._tiling(levels()) for levels in (noise_mipmaps, stone_mipmaps))

    @property
    def device(self) -> str:
        """What draws, in words."""
        return str(self.context.info["GL_RENDERER"])

    def draw(
        self,
        surface: Surface,
        scene: Scene,
        channels: Channels = PLAIN_CHANNELS,
        progress: Callable[[float], None] | None = None,
        *,
        bare: bool = False,
    ) -> Picture:
        """The picture of a scene. ``progress`` is told the share that is done; ``bare``: only the ground is drawn."""
        # Another context may have been made, or used, in between.
        with self.context:
            made = self._picture(surface, scene, channels, progress, bare=bare)
            self.context.gc()
            return made

    def _picture(
        self,
        surface: Surface,
        scene: Scene,
        channels: Channels,
        progress: Callable[[float], None] | None,
        *,
        bare: bool,
    ) -> Picture:
        lakes = surface.lakes(scene.settings)
        water = Surfaces(lakes, scene.settings.sea_level_m)
        cut, tau = self._cut(surface, scene, water)
        _, high, _ = surface.bounds(0, np.array([(x, y) for x in range(SUBPATCHES) for y in range(SUBPATCHES)]))
        atlas = Atlas(self.context, cut.tiles(), surface)
        settings = scene.settings
        sun = sun_direction(settings.sun_azimuth_deg, settings.sun_elevation_deg)
        atlas.compute(self._normals, self._sun, settings.size_m, float(high.max()), sun)
        rivers = river_map(surface.rivers(settings), settings.size_m, settings.wetness)
        resources, amplitude = self._resources(atlas, scene, channels, lakes, rivers)
        words = _words(cut, atlas)
        out = np.empty((scene.camera.height, scene.camera.width, 3), dtype=np.uint8)
        parts = _parts(scene.camera.width, scene.camera.height)
        for done, rect in enumerate(parts):
            if progress is not None:
                progress(done / len(parts))
            values = view_values(
                scene, rect, surface.range_m, amplitude, lakes=lakes is not None, rivers=rivers is not None
            )
            view = StructLayout(sources.background(self._detail), "View").pack(values)
            resources.buffers["view"] = self.context.buffer(view)
            seen = self._seen(cut, scene, rect, surface)
            records = _Records(self.context, cut, words, seen, _water_patches(cut, words, seen, scene.settings, lakes))
            out[rect.top : rect.top + rect.height, rect.left : rect.left + rect.width] = self._part(
                rect, scene, resources, records, bare=bare
            )
        if progress is not None:
            progress(1.0)
        return Picture(out, tau, len(cut.level))

    def _seen(self, cut: Cut, scene: Scene, rect: Rect, surface: Surface) -> NDArray[np.bool_]:
        """The patches that a part of the picture may show: a large one has many parts."""
        camera, settings = scene.camera, scene.settings
        planes = frustum(part(eye_projection(camera), camera, *rect))
        foot = base_height(surface.range_m[0], settings.size_m)
        return cut.within(camera, planes, foot)

    def _cut(self, surface: Surface, scene: Scene, water: Surfaces) -> tuple[Cut, float]:
        tau = scene.tau_px
        while True:
            cut = choose(surface, scene.camera, tau, water)
            if len(cut.tiles()) <= MAX_SLOTS:
                return cut, tau
            tau *= COARSER

    # --- what shaders read

    def _samplers(self) -> dict[str, moderngl.Sampler]:
        linear = (moderngl.LINEAR, moderngl.LINEAR)
        plain = self._detail == "plain"
        sharp = not plain and not any(name in self.device for name in NO_ANISOTROPY)
        mips = (moderngl.LINEAR_MIPMAP_NEAREST if plain else moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return {
            "nearest": self.context.sampler(
                repeat_x=False, repeat_y=False, filter=(moderngl.NEAREST, moderngl.NEAREST)
            ),
            "smooth_clamp": self.context.sampler(repeat_x=False, repeat_y=False, filter=linear),
            "smooth_repeat": self.context.sampler(filter=mips, anisotropy=ANISOTROPY if sharp else 1.0),
        }

    def _tiling(self, levels: tuple[NDArray[np.uint8], ...]) -> moderngl.Texture:
        texture = self.context.texture((len(levels[0]),) * 2, 4, levels[0].tobytes())
        texture.build_mipmaps(0, len(levels) - 1)
        for level, data in enumerate(levels):
            texture.write(data.tobytes(), level=level, alignment=1)
        return texture

    def _resources(
        self,
        atlas: Atlas,
        scene: Scene,
        channels: Channels,
        lakes: Lakes | None,
        rivers: NDArray[np.float32] | None,
    ) -> tuple[Resources, float]:
        """All that passes bind but the view, and the amplitude that the channel texture's 1 stands for."""
        radiance, ambient = self._bake(scene)
        texels, amplitude = channel_texels(channels)
        grid = self.context.texture((texels.shape[1], texels.shape[0]), 2, texels.tobytes(), alignment=1)
        textures: dict[str, moderngl.Texture | moderngl.TextureArray] = {
            **atlas.textures,
            "sky_lut": radiance,
            "noise": self._noise,
            "stones": self._stones,
            "channels": grid,
            "lake_map": self._lake_map(lakes),
            "river_map": self._river_map(rivers),
        }
        return Resources(textures, self._fixed, {"skylight": ambient, "pages": atlas.pages}), amplitude

    def _lake_map(self, lakes: Lakes | None) -> moderngl.Texture:
        texels = np.zeros((2, 2, 2), dtype=np.float32) if lakes is None else lake_texture(lakes)
        return self.context.texture(texels.shape[:2], 2, texels.tobytes(), dtype="f4")

    def _river_map(self, rivers: NDArray[np.float32] | None) -> moderngl.Texture:
        texels = np.zeros((1, 1, 4), dtype=np.float32) if rivers is None else rivers
        rows, columns = texels.shape[:2]
        return self.context.texture((columns, rows), 4, texels.tobytes(), dtype="f4")

    def _bake(self, scene: Scene) -> tuple[moderngl.Texture, moderngl.Buffer]:
        module = sources.sky()
        width, height = (sources.number(module, name) for name in ("SKY_WIDTH", "SKY_HEIGHT"))
        radiance = self.context.texture((width, height), 4, dtype="f2")
        radiance.filter = (moderngl.NEAREST, moderngl.NEAREST)
        ambient = self.context.buffer(reserve=8 * 16)
        settings = scene.settings
        sun = np.array([*sun_direction(settings.sun_azimuth_deg, settings.sun_elevation_deg), 0.0], dtype="<f4")
        buffers = {"job": self.context.buffer(sun.tobytes()), "ambient_out": ambient}
        resources = Resources({"sky_in": radiance}, self._fixed, buffers, {"sky_out": radiance})
        self._sky[0].run(resources, (-(-width // 8), -(-height // 8), 1))
        self._sky[1].run(resources, (1, 1, 1))
        return radiance, ambient

    # --- passes

    def _pass(self, name: str, look: str) -> Draw:
        """The program of a pass, made at its first use."""
        key = (name, look if name == "terrain" else "")
        if key not in self._draws:
            if name == "terrain":
                module = sources.terrain(look, self._detail)
            else:
                module = sources.wall(self._detail) if name == "wall" else sources.background(self._detail)
            self._draws[key] = Draw(
                self.context,
                module,
                f"{name}_vertex",
                f"{name}_fragment",
                patches=self._factor if name in ("terrain", "water") else 0,
                half_depth=self._half_depth,
            )
        return self._draws[key]

    def _part(self, rect: Rect, scene: Scene, resources: Resources, records: _Records, *, bare: bool) -> Pixels:
        """The pixels of one part of the picture."""
        context, size = self.context, (rect.width, rect.height)
        samples = 0 if self._detail == "plain" else SAMPLES
        colour = context.renderbuffer(size, 4, samples=samples)
        target = context.framebuffer([colour], depth_buffer(context, *size, samples))
        target.use()
        context.enable_only(moderngl.DEPTH_TEST)
        target.clear(*self._clear, 1.0, depth=0.0 if self._half_depth else 0.5)
        self._passes(target, rect, scene, resources, records, bare=bare)
        result = target
        if samples:
            result = context.framebuffer([context.renderbuffer(size, 4)])
            context.copy_framebuffer(result, target)
        pixels = np.frombuffer(result.read(components=3, alignment=1), dtype=np.uint8).reshape(
            rect.height, rect.width, 3
        )
        return pixels[::-1]

    def _passes(
        self,
        target: moderngl.Framebuffer,
        rect: Rect,
        scene: Scene,
        resources: Resources,
        records: _Records,
        *,
        bare: bool,
    ) -> None:
        """The page's order: ground, walls, open sea, sky, water over the ground (frontend/src/gpu/renderer.ts)."""
        look = scene.settings.look
        sea = scene.settings.sea_level_m is not None
        frame = (float(rect.left), float(rect.top + rect.height))

        def run(
            name: str,
            records: moderngl.Buffer | None,
            count: int,
            *,
            layout: str = "4u4",
            test: str = ">",
            writes: bool = True,
        ) -> None:
            if count == 0:
                return
            self.context.depth_func = test
            target.depth_mask = writes
            self._pass(name, look).run(resources, frame, records=records, layout=layout, count=count)

        run("terrain", records.all, records.count)
        if bare:
            return
        if scene.instances:
            self._plant(resources, frame, records, scene)
        run("wall", records.walls, records.wall_count, layout="4u4 1u4 /i")
        if sea:
            run("open_sea", None, 24)
        run("background", None, 3, test=">=", writes=False)
        self.context.enable(moderngl.BLEND)
        over = (moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA)
        self.context.blend_func = (*over, moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA)  # type: ignore[assignment]
        run("water", records.water, records.water_count, layout="4u4 4f4", writes=False)
        self.context.disable(moderngl.BLEND)
        target.depth_mask = True

    def _plant(self, resources: Resources, frame: tuple[float, float], records: _Records, scene: Scene) -> None:
        """Trees, rocks and tufts on the ground that was drawn."""
        if self._instances is None:
            self._instances = Instances(self.context, half_depth=self._half_depth)
        found = self._instances.find(resources, records.all, records.count, scene.settings.size_m)
        self._instances.draw(resources, frame, found)


class _Records:
    """Patches of the cut on the device; ground/patch.wgsl says what the words are. ``seen``: which ones; ``water``: of
    water, (n, 8)."""

    def __init__(
        self,
        context: moderngl.Context,
        cut: Cut,
        words: NDArray[np.uint32],
        seen: NDArray[np.bool_],
        water: NDArray[np.uint32],
    ) -> None:
        borders = np.where(seen, cut.border, 0).tolist()
        sides = [(i, bit) for i, border in enumerate(borders) for bit in (1, 2, 4, 8) if border & bit]
        walls = np.array([[*words[i], bit] for i, bit in sides], dtype=np.uint32).reshape(-1, 5)
        ground = words[seen]
        self.count, self.wall_count, self.water_count = len(ground), len(walls), len(water)
        self.all, self.walls, self.water = (_buffer(context, data) for data in (ground, walls, water))


def _buffer(context: moderngl.Context, data: NDArray[np.uint32]) -> moderngl.Buffer:
    return context.buffer(np.ascontiguousarray(data).tobytes() or bytes(16))


def _words(cut: Cut, atlas: Atlas) -> NDArray[np.uint32]:
    """Patch records: (n, 4). Column, edge bits; row, level; own and parent's slot, own weight; four corner weights."""
    own, parent = [], []
    for level, (px, py) in zip(cut.level.tolist(), cut.nodes.tolist(), strict=True):
        x, y = px // SUBPATCHES, py // SUBPATCHES
        own.append(atlas.slots[level, x, y])
        parent.append(atlas.slots[level - 1, x >> 1, y >> 1] if level else own[-1])
    corner = cut.nodes * PATCH_CELLS
    out = np.empty((len(cut.level), 4), dtype=np.uint32)
    out[:, 0] = corner[:, 0] | cut.edges << 24 | cut.border << 28
    out[:, 1] = corner[:, 1] | cut.level << 24 | cut.wet.astype(np.int64) << 31
    out[:, 2] = np.array(own) | np.array(parent) << 12 | cut.morph.astype(np.int64) << 24
    out[:, 3] = np.ascontiguousarray(cut.corners).view("<u4")[:, 0]
    return out


def _water_patches(
    cut: Cut, words: NDArray[np.uint32], seen: NDArray[np.bool_], settings: TerrainSettings, lakes: Lakes | None
) -> NDArray[np.uint32]:
    """Patches of water, (n, 8): record, level, level that the lake is known by, waves. The sea comes first
    (frontend/src/gpu/passes/patches.ts)."""
    waves = {} if lakes is None else waves_of(lakes, settings.size_m)
    rows: list[tuple[int, float, float, float]] = []
    sea = settings.sea_level_m
    for i in np.flatnonzero(seen & cut.wet).tolist():
        low = cut.near[i, 2]
        if sea is not None and low < sea:
            rows.append((i, sea, NO_LAKE, 1.0))
        if lakes is not None:
            px, py = cut.nodes[i].tolist()
            found = levels_on(lakes, int(cut.level[i]), px, py)
            rows += [(i, level, level, waves[level]) for level in found if low < level]
    rows.sort(key=lambda row: row[2] > NO_LAKE)
    out = np.zeros((len(rows), 8), dtype=np.uint32)
    if rows:
        at = np.array([row[0] for row in rows])
        out[:, :4] = words[at]
        out[:, 4:7] = np.array([row[1:] for row in rows], dtype=np.float32).view(np.uint32)
    return out


def channel_texels(channels: Channels) -> tuple[Pixels, float]:
    """(side, side, 2) bytes, amplitude in parts of its greatest value, and that value (gpu/atlas/channeltexture.ts)."""
    side = max(len(channels.amplitude), len(channels.roughness))
    grids = []
    for values in channels:
        at = np.floor(np.arange(side) * ((len(values) - 1) / (side - 1)) + 0.5).astype(np.int64)
        grids.append(values[np.ix_(at, at)].astype(np.float64))
    full = max(float(channels.amplitude.max()), 1e-3)
    parts = (np.maximum(grids[0], 0) / full, np.clip(grids[1], 0, 1))
    return np.floor(np.stack(parts, axis=-1) * 255 + 0.5).astype(np.uint8), full


def _parts(width: int, height: int) -> list[Rect]:
    """Rectangles that cover a picture, their corners on even pixels: derivatives are taken over squares of two."""
    rows, cols = (range(0, n, LARGEST_PART) for n in (height, width))
    return [Rect(x, y, min(LARGEST_PART, width - x), min(LARGEST_PART, height - y)) for y in rows for x in cols]
