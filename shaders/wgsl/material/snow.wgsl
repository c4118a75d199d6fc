// Snow and sand: what the wind lays down.

// Snow: drifts, ripples that the wind cut, grains that glitter.
fn snowfield(s: Site) -> Material {
  let drift = 0.97 + 0.05 * (s.macro2.r - 0.5) + 0.03 * (s.fine1.r - 0.5) + 0.05 * (s.near.r - 0.5);
  // Sastrugi: ridges of a hand to a few metres, drawn out with the wind, strongest where it is open and level.
  let along = vec2f(0.86, 0.51);
  let phase = dot(s.p.xy, along.yx * vec2f(-1.0, 1.0)) * 5.5 + s.fine2.r * 16.0 + s.wide.r * 1.5;
  let cut = ripple_slope(along.yx * vec2f(-1.0, 1.0), phase, s.footprint, 1.15) * 0.16 * smoothstep(0.42, 0.62, s.fine2.g);
  return Material(vec3f(0.80, 0.83, 0.87) * drift, fine_relief(s, 0.085) + vec3f(cut, 0.0), 0.5, 0.30, mix(0.86, 1.0, s.near.r),
    0.62 + 0.2 * s.fine2.r + 0.12 * s.near.r);
}

// How well a place holds snow: hollows and the lee of the relief, not the ribs.
fn holds_snow(s: Site) -> f32 {
  return (0.5 - s.fine1.g) * 0.55 + (0.5 - s.fine2.r) * 0.50 + (s.macro2.r - 0.5) * 0.30 + (0.5 - s.near.r) * 0.30
    + (s.wide.r - 0.5) * 0.20 + clamp(s.curvature, -0.3, 0.3) * 0.8 - 0.22 * smoothstep(0.35, 1.2, s.steep);
}

// Sand: ripples a hand apart across the wind, on dunes of some metres; coarse grains in the troughs.
fn sand(s: Site, colour: vec3f) -> Material {
  let wind = vec2f(0.62, 0.78);
  let dune = s.fine1.r * 9.0 + s.macro2.r * 30.0;
  let broad = dot(s.p.xy, wind) * 0.55 + dune;
  let fine = dot(s.p.xy, wind) * 42.0 + s.fine2.r * 26.0 + dune * 2.0;
  let calm = 1.0 - smoothstep(0.30, 0.55, s.steep);
  let slope = ripple_slope(wind, broad, s.footprint, 11.4) * 0.06 + ripple_slope(wind, fine, s.footprint, 0.15) * (0.26 * calm);
  let trough = (0.5 - 0.5 * sin(fine)) * smoothstep(0.045, 0.012, s.footprint) * calm;
  let tone = 0.90 + 0.14 * (s.fine1.r - 0.5) + 0.10 * (s.wide.r - 0.5) + 0.20 * s.near.r - 0.10 * trough;
  return Material(colour * tone, fine_relief(s, 0.10) + vec3f(slope, 0.0), 0.0, 0.1, mix(0.85, 1.0, s.near.r), 0.45 + 0.3 * s.near.r - 0.2 * trough);
}
