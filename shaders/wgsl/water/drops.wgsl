// Drops of rain: small discs that face the eye, streaks while they fall. Hills hide them.
struct DropIn {
  @location(0) drop: vec4f,   // xyz; w = how far it is shown, 0..1, and 2 more while it falls
};

struct DropVertex {
  @builtin(position) position: vec4f,
  @location(0) at: vec2f,     // -1..1 over the quad
  @location(1) @interpolate(flat) shown: f32,
  @location(2) @interpolate(flat) falls: f32,
};

const DROP_PX: f32 = 1.7;
const STREAK_PX: f32 = 7.0;

// Towards the eye, as lines on the ground are (marks/ribbon.wgsl).
fn drop_clip(p: vec3f) -> vec4f {
  let away = distance(p, view.eye.xyz);
  let pull = min(0.004 * away + 0.0012 * view.size, 0.5 * away);
  return to_clip(p - ray_to(p) * pull);
}

@vertex
fn drop_vertex(@builtin(vertex_index) index: u32, in: DropIn) -> DropVertex {
  let corner = vec2f(f32(index & 1u) * 2.0 - 1.0, f32(index >> 1u) * 2.0 - 1.0);
  let falls = f32(in.drop.w >= 2.0);
  let clip = drop_clip(in.drop.xyz);
  let half = vec2f(DROP_PX, mix(DROP_PX, STREAK_PX, falls)) * view.line_scale + 0.75;
  var out: DropVertex;
  out.position = vec4f(clip.xy + corner * half * 2.0 / view.viewport * clip.w, clip.zw);
  if (clip.w <= 0.0) { out.position = vec4f(0.0, 0.0, -2.0, 1.0); }
  out.at = corner;
  out.shown = in.drop.w - 2.0 * falls;
  out.falls = falls;
  return out;
}

@fragment
fn drop_fragment(v: DropVertex) -> @location(0) vec4f {
  let away = length(v.at);
  let body = 1.0 - smoothstep(0.45, 1.0, away);
  let shine = 1.0 - smoothstep(0.1, 0.55, length(v.at - vec2f(-0.25, 0.3)));
  let streak = (1.0 - abs(v.at.x)) * (1.0 - v.at.y * v.at.y) * 0.6;
  let rgb = mix(vec3f(0.16, 0.46, 0.86), vec3f(0.86, 0.95, 1.0), max(0.55 * shine, 0.7 * v.falls));
  return vec4f(rgb, mix(body, streak, v.falls) * v.shown * 0.9);
}
