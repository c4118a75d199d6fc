// What grows: meadows and woods.

// How much of a forest's crowns is seen: who stands among the trees sees what grows below them.
fn afar(s: Site) -> f32 {
  return 0.25 + 0.75 * smoothstep(0.04, 0.35, s.footprint);
}

// A meadow: many kinds of grass, each in patches of some metres, tussocks, straw, flowers where it is lush.
fn meadow(s: Site, lush: vec3f, dry: vec3f, dryness: f32) -> Material {
  let kinds = (s.fine2.r - 0.5) * 0.9 + (s.fine1.g - 0.5) * 0.5 + (s.wide.g - 0.5) * 0.25;
  let part = clamp(dryness + kinds * 0.55, 0.0, 1.0);
  // A third kind, darker and bluer, between them: sedge and heath in the hollows.
  let sedge = smoothstep(0.52, 0.70, s.fine2.g * 0.6 + s.fine1.r * 0.4 + s.cover.wet * 0.2);
  let colour = mix(mix(lush, dry, part), lush * vec3f(0.62, 0.74, 0.86), 0.55 * sedge);
  let tone = 0.80 + 0.16 * (s.macro2.g - 0.5) + 0.24 * (s.wide.r - 0.5) + 0.40 * s.near.r;
  let m = Material(colour * tone, fine_relief(s, 0.16), 0.0, 0.16, mix(0.55, 1.0, s.near.r), 0.25 + 0.35 * s.near.r + 0.2 * s.fine2.r);
  return tufted(m, s, part);
}

// Crowns: a relief of their own, dark between.
fn canopy(s: Site, dark: vec3f, light: vec3f) -> Material {
  let crown = smoothstep(0.22, 0.78, 0.30 * s.fine1.g + 0.55 * s.fine2.r + 0.15 * s.near.r);
  let stand = smoothstep(0.25, 0.75, s.macro2.g * 0.6 + s.fine1.r * 0.4);
  let m = Material(mix(dark, light, stand) * (0.40 + 1.10 * crown), fine_relief(s, 0.62), 0.0, 0.20, 0.45 + 0.55 * crown, 0.5 + 0.5 * crown);
  return crowned(m, s);
}
