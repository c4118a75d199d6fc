// Winter: snow wherever it can lie, bare rock where it cannot. One look_*.wgsl is part of the terrain module.
const TREE_LINE: f32 = 0.060;

fn ground_material(s: Site) -> Material {
  let c = s.cover;
  // Under the snow: faces of rock, else brown turf.
  let turf = Material(vec3f(0.125, 0.105, 0.070) * (0.75 + 0.5 * s.fine2.r), fine_slope(s, 0.25), 0.0, 0.0);
  var m = mix_in(turf, rock(s, vec3f(0.235, 0.226, 0.220), vec3f(0.056, 0.056, 0.060), 0.48), steeper(s, 0.62, 0.2));
  // The channel has no forest where snow lies: woods stand in it below the tree line, as broad noise and slopes have them.
  let gentle = (1.0 - smoothstep(0.62 * TREE_LINE, TREE_LINE, s.height)) * (1.0 - smoothstep(0.7, 1.0, s.steep));
  let stand = s.macro1.g * 0.48 + s.macro2.r * 0.42 + s.fine1.r * 0.14 + clamp(s.steep, 0.0, 0.6) * 0.2 + clamp(s.curvature, -0.1, 0.1) * 0.9;
  let wood = max(smoothstep(0.56, 0.64, stand) * gentle, covered(c.forest, (s.fine1.g - 0.5) * 0.4, 0.16));
  // Trees carry snow: dark where the crowns are in the lee of each other.
  let white = smoothstep(0.48, 0.80, s.fine1.g * 0.6 + s.fine2.r * 0.4) * covered(c.snow + c.forest, 0.0, 0.3);
  let crowns = Material(mix(vec3f(0.020, 0.032, 0.026), vec3f(0.36, 0.39, 0.43), white), fine_slope(s, 0.6), 0.1, 0.2);
  // Snow keeps to ledges and gullies: beds and the fine relief decide.
  let beds = strata(s);
  let hold = (s.fine1.g - 0.5) * 0.80 + (s.fine2.r - 0.5) * 0.40 + (s.macro2.r - 0.5) * 0.35 + (0.5 - beds.a) * 1.4;
  m = mix_in(m, snowfield(s), covered(c.snow, clamp(s.curvature, -0.3, 0.3) * 0.6 - hold - 0.14, 0.17));
  m = mix_in(m, crowns, wood * 0.94);
  return shore(m, s, vec3f(0.40, 0.37, 0.33));
}
