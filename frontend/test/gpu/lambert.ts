/**
 * The plain shadings in which renderers are compared: `lambert`, as three.js draws, has one sun, one ambient term, no air;
 * `flat`, as CesiumJS draws without imagery, is one colour.
 */

/** Colour of the ground (linear), light of the sun and of the sky, colour behind (linear). */
const SHADING = /* wgsl */ `
fn lambert(gradient: vec2f, sun: vec3f) -> vec4f {
  let n = normalize(vec3f(-gradient, 1.0));
  let light = (3.0 * max(dot(n, sun), 0.0) + 0.4) / 3.14159265;
  return vec4f(encoded(vec3f(0.2623, 0.2159, 0.1413) * light), 1.0);
}

fn encoded(linear: vec3f) -> vec3f {
  return select(1.055 * pow(linear, vec3f(1.0 / 2.4)) - 0.055, linear * 12.92, linear <= vec3f(0.0031308));
}
`;

const GROUND = /* wgsl */ `
struct PlainVertex {
  @builtin(position) position: vec4f,
  @location(0) at: vec2f,
  @location(1) morph: f32,
  @location(2) @interpolate(flat) origins: vec4f,
  @location(3) @interpolate(flat) layers: vec2i,
};

@vertex
fn terrain_vertex(@builtin(vertex_index) index: u32, patch_in: PatchIn) -> PlainVertex {
  let v = patch_vertex(patch_in.record, vec2i(i32(index % PITCH), i32(index / PITCH)));
  let texels = patch_texels(patch_in.record);
  return PlainVertex(guarded(clip_of(v.relative)), v.at, v.morph, texels.origins, texels.layers);
}

@fragment
fn terrain_fragment(v: PlainVertex) -> @location(0) vec4f {
  let texels = PatchTexels(v.origins, v.layers);
  var s = textureSampleLevel(slopes, smooth_clamp, own_uv(texels, v.at), v.layers.x, 0.0).xy;
  if (v.morph > 0.0) {
    s = mix(s, textureSampleLevel(slopes, smooth_clamp, parent_uv(texels, v.at), v.layers.y, 0.0).xy, v.morph);
  }
  return lambert(s, view.sun.xyz);
}
`;

const FLAT_GROUND = /* wgsl */ `
@vertex
fn terrain_vertex(@builtin(vertex_index) index: u32, patch_in: PatchIn) -> @builtin(position) vec4f {
  return guarded(clip_of(patch_vertex(patch_in.record, vec2i(i32(index % PITCH), i32(index / PITCH))).relative));
}

@fragment
fn terrain_fragment() -> @location(0) vec4f { return vec4f(0.55, 0.5, 0.42, 1.0); }
`;

/** Of linear (0.6, 0.75, 0.9), display-encoded: peers clear to a colour, so it is none that each pixel computes. */
export const BEHIND_COLOUR = [0.6, 0.75, 0.9].map((v) => 1.055 * v ** (1 / 2.4) - 0.055);

const BEHIND = /* wgsl */ `
@vertex
fn background_vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
  return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn background_fragment() -> @location(0) vec4f { return vec4f(${BEHIND_COLOUR.join(", ")}, 1.0); }
`;

/** Cuts a module off before its first entry point's own struct and puts plain entry points there. */
function cut(code: string, before: string, plain: string): string {
  const at = code.indexOf(before);
  if (at < 0) throw new Error(`the shader has no ${before}`);
  return code.slice(0, at) + SHADING + plain;
}

export type Plain = "lambert" | "flat";

export const LAMBERT = {
  shading: SHADING,
  /** The module of that label as it is drawn here. */
  replace(label: string, code: string, plain: Plain = "lambert"): string {
    if (label.startsWith("terrain ")) {
      return cut(code, "struct TerrainVertex", plain === "lambert" ? GROUND : FLAT_GROUND);
    }
    if (label === "background") return cut(code, "struct BackgroundVertex", BEHIND);
    return code;
  },
};
