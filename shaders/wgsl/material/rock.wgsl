// Rock in beds and joints, and what falls from it.

// Beds of rock, tilted and warped: a column of noise that is read along the height and drawn out sideways, so beds are thick
// and thin, run out, and fade before they are finer than pixels. rg as the noise; a: of a bed's top (above 0.5) or foot.
fn strata(s: Site) -> vec4f {
  let unit = view.size / 4096.0;
  let dip = vec3f(0.11, -0.06, 1.0);
  let run = vec3f(0.034, 0.026, 0.0);
  let warp = (s.macro2.r - 0.5) * 62.0 + (s.fine1.r - 0.5) * 7.0;
  let at = vec2f(dot(s.p, run), dot(s.p, dip)) / unit + vec2f(0.0, warp);
  return noise_sample(at, vec2f(dot(s.f.dx, run), dot(s.f.dx, dip)) / unit, vec2f(dot(s.f.dy, run), dot(s.f.dy, dip)) / unit, 330.0);
}

// Dark lines where the ridges of a noise run together.
fn cracks(ridged: f32) -> f32 {
  return smoothstep(0.66, 0.90, ridged);
}

// Weathered rock: beds that stand out as ledges, joints, broad stains.
fn rock(s: Site, light: vec3f, dark: vec3f, relief: f32) -> Material {
  let beds = strata(s);
  let bed = smoothstep(0.38, 0.60, beds.r) - 0.5;
  let grain = (s.fine1.r - 0.5) * 0.50 + (s.fine2.r - 0.5) * 0.28 + (s.wide.r - 0.5) * 0.22 + (s.near.r - 0.5) * 0.34;
  let tone = clamp(0.46 + bed * 0.46 + grain * 1.25 + (s.macro2.g - 0.5) * 0.6, 0.0, 1.0);
  // Stains: rust where iron weathers out of some beds, grey and ochre lichen elsewhere.
  let rust = smoothstep(0.54, 0.84, s.macro2.r * 0.70 + beds.g * 0.25 + (s.fine1.g - 0.5) * 0.35);
  let lichen = smoothstep(0.56, 0.70, s.fine2.g * 0.55 + s.wide.r * 0.45) * (1.0 - 0.5 * rust);
  let hue = mix(mix(vec3f(0.95, 0.99, 1.05), vec3f(1.10, 0.98, 0.86), rust), vec3f(0.98, 1.00, 0.84), 0.40 * lichen);
  // Dark where water runs and where light does not reach: in hollows, joints, under ledges.
  let seep = smoothstep(0.03, 0.35, s.curvature + (s.fine1.r - 0.5) * 0.25);
  let joint = 0.42 * cracks(s.fine1.g) + 0.30 * cracks(s.fine2.g) + 0.34 * cracks(beds.g);
  let shade = (1.0 - 0.22 * seep) * (1.0 - 0.45 * min(joint, 0.9));
  let ledge = vec3f(0.0, 0.0, (0.5 - beds.a) * 2.6 * min(s.steep, 1.2));
  let m = Material(mix(dark, light, tone) * hue * shade, fine_relief(s, relief) + ledge, 0.0, 0.0,
    (1.0 - 0.5 * min(joint, 0.9)) * mix(0.75, 1.0, s.near.r), 0.35 + 0.5 * s.near.r + 0.3 * (s.fine2.r - 0.5));
  return broken(m, s, 1.0);
}

// Stones below the faces.
fn scree(s: Site, colour: vec3f) -> Material {
  let grain = 0.62 + 0.30 * s.fine1.r + 0.22 * (s.fine2.g - 0.5) + 0.24 * (s.wide.r - 0.5) + 0.34 * s.near.r;
  let hue = mix(vec3f(1.05, 0.99, 0.91), vec3f(0.95, 1.0, 1.05), s.fine2.r);
  let m = Material(colour * hue * grain, fine_relief(s, 0.34), 0.0, 0.0, mix(0.6, 1.0, s.near.r), 0.3 + 0.6 * s.near.r);
  return heaped(m, s, 1.0);
}

// Earth: crumbs, small stones, damp and dry places.
fn earth(s: Site, dry: vec3f, damp: vec3f) -> Material {
  let tone = 0.80 + 0.22 * (s.fine2.r - 0.5) + 0.26 * (s.wide.r - 0.5) + 0.44 * s.near.r;
  let m = Material(mix(dry, damp, s.fine1.r) * tone, fine_relief(s, 0.24), 0.0, 0.0, mix(0.7, 1.0, s.near.r), 0.25 + 0.4 * s.near.r);
  return heaped(m, s, 0.7);
}
