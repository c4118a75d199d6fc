// Winter: snow wherever it can lie, bare rock where it cannot. One look_*.wgsl is part of the terrain module.
const TREE_LINE: f32 = 0.060;

// Under the snow: faces of rock, rubble below them, else brown turf.
fn under_snow(s: Site) -> Material {
  let rocky = steeper(s, 0.66, 0.2);
  var m = bare_material();
  if (rocky < 1.0) {
    let stony = steeper(s, 0.46, 0.14);
    if (stony < 1.0) { m = meadow(s, vec3f(0.098, 0.092, 0.056), vec3f(0.165, 0.135, 0.084), 0.6); }
    if (stony > 0.0) { m = laid(m, scree(s, vec3f(0.170, 0.165, 0.160)), stony); }
  }
  if (rocky > 0.0) { m = laid(m, rock(s, vec3f(0.225, 0.219, 0.214), vec3f(0.056, 0.056, 0.060), 0.48), rocky); }
  return m;
}

fn ground_material(s: Site) -> Material {
  let c = s.cover;
  // Snow keeps to ledges and gullies: beds and the fine relief decide.
  let beds = strata(s);
  let ledge = (beds.a - 0.5) * 1.5 * smoothstep(0.3, 0.8, s.steep) + (0.5 - s.fine1.g) * 0.5 + (0.5 - s.wide.g) * 0.25 + 0.12;
  let snowy = scattered(c.snow, holds_snow(s) + ledge);
  var m = bare_material();
  if (snowy < 1.0) { m = under_snow(s); }
  let snow = snowfield(s);
  m = laid(m, snow, snowy);
  // The channel has no forest where snow lies: woods stand in it below the tree line, as broad noise and slopes have them.
  let gentle = (1.0 - smoothstep(0.62 * TREE_LINE, TREE_LINE, s.height)) * (1.0 - smoothstep(0.7, 1.0, s.steep));
  let stand = s.macro1.g * 0.48 + s.macro2.r * 0.42 + s.fine1.r * 0.14 + clamp(s.steep, 0.0, 0.6) * 0.2 + clamp(s.curvature, -0.1, 0.1) * 0.9;
  let wood = max(smoothstep(0.56, 0.64, stand) * gentle, covered(c.forest, (s.fine1.g - 0.5) * 0.4, 0.16)) * 0.94 * afar(s);
  if (wood > 0.0) {
    // Trees carry snow: dark where the crowns are in the lee of each other.
    let white = smoothstep(0.48, 0.80, s.fine1.g * 0.6 + s.fine2.r * 0.4) * covered(c.snow + c.forest, 0.0, 0.3);
    let crowns = canopy(s, vec3f(0.020, 0.032, 0.026), vec3f(0.034, 0.046, 0.036));
    m = mix_in(m, mix_in(crowns, snow, 0.6 * white), wood);
  }
  return shore(m, s, vec3f(0.40, 0.37, 0.33));
}
