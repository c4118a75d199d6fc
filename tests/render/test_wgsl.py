"""WGSL to GLSL: each construct of the subset computes what WGSL says, what is outside is refused (SPEC V1)."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import moderngl
import pytest

from esker.render import sources
from esker.render.device import open_context
from esker.render.layout import StructLayout
from esker.wgsl.parse import parse
from esker.wgsl.stage import Bindings, functions, translate
from esker.wgsl.tree import WgslError


@pytest.fixture(scope="module")
def context() -> Iterator[moderngl.Context]:
    opened = open_context()
    yield opened
    opened.release()


def computed(context: moderngl.Context, statements: str, declarations: str = "") -> tuple[float, ...]:
    """What ``statements`` leave in ``out: vec4f``, after translation, on the device."""
    source = f"""
    {declarations}
    @group(0) @binding(0) var<storage, read_write> result: array<vec4f, 1>;
    @compute @workgroup_size(1)
    fn run() {{
      var out = vec4f(0.0);
      {statements}
      result[0] = out;
    }}
    """
    bindings = Bindings()
    shader = context.compute_shader(translate(parse(source), "run", bindings))
    buffer = context.buffer(bytes(16))
    buffer.bind_to_storage_buffer(bindings.storage["result"])
    shader.run()
    context.memory_barrier()
    return struct.unpack("<4f", buffer.read())


CASES = {
    "numbers take the type of what they meet": (
        "let x = 1.5; out.x = x * 2 + 1; let n = 7u; out.y = f32(n / 2);",
        (4, 3, 0, 0),
    ),
    "a constant without a suffix": (
        "const N = 3; for (var i = 0; i < N; i += 1) { out.x += f32(N) * 0.5; }",
        (4.5, 0, 0, 0),
    ),
    "swizzles and elements": ("let v = vec4f(1, 2, 3, 4); out = vec4f(v.wz, v[1], v.rgb.z);", (4, 3, 2, 3)),
    "select takes the false value first": (
        "out.x = select(1.0, 2.0, true); out.y = select(1.0, 2.0, 1 > 2);",
        (2, 1, 0, 0),
    ),
    "select by component": (
        "let s = select(vec2f(1.0, 2.0), vec2f(3.0, 4.0), vec2f(0.0, 9.0) > vec2f(5.0)); out = vec4f(s, 0, 0);",
        (1, 4, 0, 0),
    ),
    "comparisons of vectors": (
        "if (all(vec2i(1, 2) >= vec2i(1)) && !any(vec2f(1.0) == vec2f(2.0))) { out.x = 1.0; }",
        (1, 0, 0, 0),
    ),
    "remainders keep the sign of the left": (
        "out = vec4f(f32(-7 % 4), -7.5 % 2.0, f32(7u % 4u), 7.5 % 2.0);",
        (-3, -1.5, 3, 1.5),
    ),
    "bits": (
        "let a = 0xf0u; out.x = f32((a >> 4u) | 16u); out.y = f32((vec2i(5, 9) >> vec2u(1u)).y); "
        "out.z = f32(a ^ 0xffu);",
        (31, 4, 15, 0),
    ),
    "wrapping products": (
        "let h = 0x9e3779b9u * 3u; out.x = f32(h >> 8u);",
        (float((0x9E3779B9 * 3 & 0xFFFFFFFF) >> 8), 0, 0, 0),
    ),
    "bitcast": ("out.x = f32(bitcast<u32>(1.0f) >> 23u); out.y = bitcast<f32>(0x40000000u);", (127, 2, 0, 0)),
    "unpacking": ("let c = unpack4x8unorm(0xff0000ffu); out = c;", (1, 0, 0, 1)),
    "matrices by columns": (
        "let m = mat2x2f(1.0, 2.0, 3.0, 4.0); let v = m * vec2f(1.0, 10.0); out = vec4f(v, m[1]);",
        (31, 42, 3, 4),
    ),
    "arrays": (
        "let a = array<vec2f, 2>(vec2f(1.0, 2.0), vec2f(3.0, 4.0)); let i = 1u; out = vec4f(a[i], a[0]);",
        (3, 4, 1, 2),
    ),
    "variables start as zero": (
        "var v: vec3f; var a: array<f32, 3>; v.y += 2.0; a[2] = 5.0; out = vec4f(v, a[0] + a[2]);",
        (0, 2, 0, 5),
    ),
    "switch does not fall through": (
        "for (var i = 0u; i < 4u; i++) { switch (i) { case 0u: { out.x += 1.0; } case 1u, 2u: { out.y += 1.0; } "
        "default: { out.z += 1.0; } } }",
        (1, 2, 1, 0),
    ),
    "loops": (
        "var i = 0; loop { i++; if (i == 2) { continue; } if (i > 4) { break; } out.x += f32(i); } "
        "while (i > 0) { i -= 2; } out.y = f32(i);",
        (8, -1, 0, 0),
    ),
    "names that GLSL keeps": (
        "let half = 2.0; let step = half; let distance = distance(vec2f(0.0), vec2f(3.0, 4.0)); "
        "var sample = step; sample *= distance; out.x = sample;",
        (10, 0, 0, 0),
    ),
    "functions by other names": (
        "out = vec4f(atan2(1.0, 0.0), inverseSqrt(4.0), saturate(3.0), round(2.5));",
        (1.5707963, 0.5, 1, 2),
    ),
    "what is not wanted": ("_ = 1.0; out.x = 1.0;", (1, 0, 0, 0)),
}


@pytest.mark.parametrize("name", list(CASES))
def test_construct(context: moderngl.Context, name: str) -> None:
    statements, wanted = CASES[name]
    assert computed(context, statements) == pytest.approx(wanted, rel=1e-6)


def test_structs_functions_and_their_order(context: moderngl.Context) -> None:
    """WGSL lets a function stand after its callers, GLSL does not."""
    declarations = """
    fn twice(p: Pair) -> Pair { return Pair(scaled(p.low, FACTOR), scaled(p.high, FACTOR)); }
    fn scaled(v: vec2f, by: f32) -> vec2f { return v * by; }
    const FACTOR: f32 = BASE + 1;
    const BASE = 1;
    struct Pair { low: vec2f, high: vec2f, };
    """
    found = computed(
        context, "let p = twice(Pair(vec2f(1, 2), vec2f(3, 4))); out = vec4f(p.low, p.high);", declarations
    )
    assert found == (2, 4, 6, 8)


REFUSED = {
    "fn f(p: ptr<function, f32>) {}": "ptr",
    "fn f() { var x = 1.0; let p = &x; }": "pointer",
    "fn f() { loop { continuing { } } }": "continuing",
    "fn f() { let x = 1.0h; }": "16-bit",
    "@group(0) @binding(0) var t: texture_3d<f32>; fn f() { _ = textureLoad(t, vec3i(0), 0); }": "texture_3d",
    "fn f() { let x = nonsense(1.0); }": "nonsense",
    "fn f() { let x = y; }": "y",
    "fn f() { let x = vec3f(1.0).q; }": "q",
    "fn f(": "expected",
    "fn f() { 1.0; }": "statement",
    "alias T = f32;": "alias",
    "fn f() { let x = 1.0 $ 2.0; }": "$",
}


@pytest.mark.parametrize("source", list(REFUSED))
def test_what_is_outside_is_refused_with_its_line(source: str) -> None:
    with pytest.raises(WgslError, match=r"^line \d+: ") as caught:
        functions(parse(f"\n{source}"), "f")
    assert REFUSED[source] in str(caught.value)
    assert caught.value.line in (0, 2)


def test_only_what_is_reached_is_written() -> None:
    """Derivatives may not stand in a vertex shader: what no entry point reaches is left out."""
    module = sources.terrain("natural", "plain")
    assert "dFdx" not in translate(module, "terrain_vertex", Bindings())
    assert "dFdx" in translate(module, "terrain_fragment", Bindings())


def test_rows_of_a_picture_count_from_above() -> None:
    source = "@fragment fn f(@builtin(position) p: vec4f) -> @location(0) vec4f { return vec4f(dpdy(p.y)); }"
    text = translate(parse(source), "f", Bindings())
    assert "wgsl_frame.y - gl_FragCoord.y" in text
    assert "(-dFdy(" in text


def test_layout_is_that_of_webgpu() -> None:
    """Offsets as the page writes them (frontend/src/gpu/layout.ts)."""
    source = "const N: u32 = 3u; struct S { a: f32, b: vec3f, c: vec2f, d: array<vec4f, N>, e: u32, };"
    layout = StructLayout(parse(source), "S")
    assert layout.offsets == {"a": 0, "b": 16, "c": 32, "d": 48, "e": 96}
    assert layout.size == 112
    packed = layout.pack({"b": [1, 2, 3], "e": 7})
    assert struct.unpack_from("<3f", packed, 16) == (1, 2, 3)
    assert struct.unpack_from("<I", packed, 96) == (7,)
