// Sun, sky and the far ground on a rough surface.

// The smooth normal turned by a relief: only what runs along the surface turns it, so faces are as rough as level ground.
fn roughened(n: vec3f, relief: vec3f) -> vec3f {
  return normalize(n - (relief - n * dot(n, relief)));
}

// How much of the sky a place sees: what the march over the ground found, less in hollows of the drawn surface, which are too
// small for it, and between the stones of the material.
fn openness(surface: Surface, fine: f32) -> f32 {
  let hollow = clamp(1.0 - max(surface.curvature, 0.0) * 0.35, 0.55, 1.0);
  let ridge = 1.0 + 0.10 * clamp(-surface.curvature, 0.0, 1.0);
  return mix(1.0, clamp(surface.sky * hollow * ridge * mix(1.0, fine, 0.75), 0.08, 1.0), view.shade);
}

fn shade(m: Material, gradient: vec2f, surface: Surface, dir: vec3f) -> vec3f {
  // Slopes are lit as steep as they are seen.
  let broad = normalize(vec3f(-gradient * view.exaggeration, 1.0));
  let n = roughened(broad, m.relief);
  // Facing the sun counts for the fine relief; whether the sun is up at all for the broad one. Snow and leaves let light
  // round the edge.
  let turned_to = dot(n, view.sun.xyz);
  let facing = max((turned_to + m.soft * 0.5) / (1.0 + m.soft * 0.5), max(turned_to, 0.0)) * smoothstep(-0.10, 0.14, dot(broad, view.sun.xyz));
  let open = openness(surface, m.open);
  // A low sun does not reach the bottom of joints either.
  let reached = mix(1.0, smoothstep(0.0, 0.55, m.open), 0.5 * view.shade);
  let sun = sun_light() * (max(facing, 0.0) * surface.sun * reached / 3.14159265);
  // Light that the ground passes on to itself takes its colour (Jimenez et al., "Practical Real-Time Strategies for
  // Accurate Indirect Occlusion", 2016): hollows in snow stay bright, those in woods go dark.
  let a = 2.0404 * m.albedo - vec3f(0.3324);
  let b = -4.7951 * m.albedo + vec3f(0.6417);
  let c = 2.7552 * m.albedo + vec3f(0.6903);
  let lit = max(vec3f(open), ((open * a + b) * open + c) * open);
  // The lit land around adds to what comes from a clear sky.
  let above = ambient_light(n);
  let grey = vec3f(dot(above, vec3f(0.2126, 0.7152, 0.0722)));
  let sky = mix(above, grey * 1.12, 0.28) * lit * 1.45;
  // From the sunlit slopes around, strongest where little sky is seen and on what faces down.
  let bounce = sun_light() * (0.32 * max(view.sun.z, 0.0) / 3.14159265) * ((1.0 - surface.sky) + 0.25 * (1.0 - n.z)) * (m.albedo * 0.5 + vec3f(0.12));
  var colour = m.albedo * (sun + sky + bounce);
  if (m.gloss > 0.0) {
    let half_way = normalize(view.sun.xyz - dir);
    let sheen = pow(max(dot(n, half_way), 0.0), 24.0) * 0.10 + pow(max(dot(dir, view.sun.xyz), 0.0), 6.0) * 0.05;
    colour += sun_light() * surface.sun * sheen * m.gloss * max(facing, 0.0);
  }
  return colour;
}
