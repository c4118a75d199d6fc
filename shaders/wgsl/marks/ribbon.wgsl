// Strokes and their shadows: camera-facing ribbons of constant width on the screen. An instance is a segment with its
// neighbours, so that joints are mitred. Drawn twice: in front of the ground in full, behind it dimmed and dashed.
struct RibbonIn {
  @location(0) before: vec4f,   // xyz; w = metres along the line
  @location(1) start: vec4f,
  @location(2) stop: vec4f,
  @location(3) after: vec4f,
  @location(4) colour: vec4f,   // display-encoded
  @location(5) style: vec4f,    // half width in pixels, halo in pixels, opacity where hidden, 1 = a segment (0: a gap)
};

struct RibbonVertex {
  @builtin(position) position: vec4f,
  @location(0) across: f32,     // pixels from the middle
  @location(1) along: f32,      // metres along the line
  @location(2) @interpolate(flat) colour: vec4f,
  @location(3) @interpolate(flat) style: vec4f,
  @location(4) world: vec3f,
};

override HIDDEN: u32 = 0u;

fn to_pixels(clip: vec4f) -> vec2f {
  return clip.xy / max(clip.w, 1.0e-4) * 0.5 * view.viewport;
}

// Towards the eye, so that a line on the ground is not eaten by it; the place on the screen stays.
fn lifted(p: vec3f) -> vec4f {
  let away = distance(p, view.eye.xyz);
  let pull = min(0.004 * away + 0.0012 * view.size, 0.5 * away);
  return to_clip(p - ray_to(p) * pull);
}

@vertex
fn ribbon_vertex(@builtin(vertex_index) index: u32, in: RibbonIn) -> RibbonVertex {
  let end = index >> 1u;
  let side = f32(index & 1u) * 2.0 - 1.0;
  let here = select(in.start, in.stop, end == 1u);
  let clip = lifted(here.xyz);
  let p = to_pixels(clip);
  let a = to_pixels(to_clip(in.start.xyz));
  let b = to_pixels(to_clip(in.stop.xyz));
  let other = to_pixels(to_clip(select(in.before.xyz, in.after.xyz, end == 1u)));
  let dir = unit(b - a, vec2f(1.0, 0.0));
  let next = unit(select(a - other, other - b, end == 1u), dir);
  let middle = unit(dir + next, dir);
  let normal = vec2f(-middle.y, middle.x);
  let stretch = 1.0 / max(dot(middle, dir), 0.45);
  let reach = in.style.x + in.style.y + 1.0;
  let offset = normal * side * reach * stretch;
  var out: RibbonVertex;
  let ok = in.style.w > 0.5 && (to_clip(in.start.xyz)).w > 0.0 && (to_clip(in.stop.xyz)).w > 0.0;
  out.position = select(vec4f(0.0, 0.0, -2.0, 1.0), vec4f(clip.xy + offset * 2.0 / view.viewport * clip.w, clip.zw), ok);
  out.across = side * reach;
  out.along = here.w;
  out.colour = in.colour;
  out.style = in.style;
  out.world = here.xyz;
  return out;
}

fn unit(v: vec2f, otherwise: vec2f) -> vec2f {
  let l = length(v);
  return select(otherwise, v / max(l, 1.0e-5), l > 1.0e-3);
}

@fragment
fn ribbon_fragment(v: RibbonVertex) -> @location(0) vec4f {
  let away = abs(v.across);
  let core = clamp(v.style.x + 0.5 - away, 0.0, 1.0);
  let rim = clamp(v.style.x + 1.5 - away, 0.0, 1.0);
  let halo = select(0.0, pow(clamp(1.0 - (away - v.style.x) / max(v.style.y, 0.01), 0.0, 1.0), 2.0), v.style.y > 0.0);
  let metres = pixel_size(v.world);
  if (HIDDEN == 1u) {
    let dash = smoothstep(0.40, 0.48, abs(fract(v.along / (metres * 11.0)) - 0.5) * 2.0);
    return vec4f(v.colour.rgb, core * v.style.z * v.colour.a * (1.0 - dash));
  }
  let glow = halo * 0.45;
  let alpha = max(max(core, rim * 0.45), glow) * v.colour.a;
  // A dark rim keeps a pale line readable on snow.
  let rgb = mix(select(v.colour.rgb * 0.22, v.colour.rgb, glow > rim * 0.45), v.colour.rgb, core);
  return vec4f(rgb, alpha);
}
