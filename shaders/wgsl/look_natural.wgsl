// Meadows, woods, scree, rock and snow. One look_*.wgsl is part of the terrain module.
fn ground_material(s: Site) -> Material {
  // Meadows: lush in hollows and low down, dry and pale on rises and higher up.
  let dry = smoothstep(0.25, 0.85, 0.5 + (s.macro1.r - 0.5) * 1.5 + (s.macro2.r - 0.5) * 0.7 + s.height * 3.2 - s.curvature * 0.8);
  let tone = 0.86 + 0.26 * (s.fine1.r - 0.5) + 0.30 * (s.fine2.r - 0.5) + 0.20 * (s.macro2.g - 0.5);
  let meadow = mix(vec3f(0.088, 0.122, 0.034), vec3f(0.215, 0.186, 0.084), dry) * tone;
  var m = Material(meadow, fine_slope(s, 0.13), 0.0);
  // Forest in large woods with frayed edges, on gentle and moderate slopes below the tree line.
  let line = 0.085 + (s.macro1.g - 0.5) * 0.03 + (s.macro2.r - 0.5) * 0.02;
  let below = 1.0 - smoothstep(line * 0.62, line, s.height);
  let grows = (1.0 - smoothstep(0.70, 1.0, s.steep)) * below;
  let cover = s.macro1.g * 0.50 + s.macro2.r * 0.42 + s.fine1.r * 0.12 + clamp(s.steep, 0.0, 0.6) * 0.16 + clamp(s.curvature, -0.1, 0.1) * 0.9;
  let wood = smoothstep(0.575, 0.64, cover) * grows;
  let crown = mix(vec3f(0.024, 0.046, 0.018), vec3f(0.052, 0.074, 0.024), s.macro2.g) * (0.55 + 0.5 * s.fine1.g + 0.4 * s.fine2.r);
  m = mix_in(m, Material(crown, fine_slope(s, 0.55), 0.0), wood * 0.94);
  // Scree and rubble below the faces, and the bare ground above the meadows.
  let rubble = Material(vec3f(0.225, 0.200, 0.168) * (0.74 + 0.5 * s.fine2.r), fine_slope(s, 0.26), 0.0);
  m = mix_in(m, rubble, steeper(s, 0.72, 0.17) * 0.8);
  let alp = smoothstep(0.105, 0.165, s.height + (s.macro2.r - 0.5) * 0.05 + (s.fine1.r - 0.5) * 0.02);
  m = mix_in(m, rubble, alp * 0.75);
  let rock = Material(rock_colour(s, vec3f(0.300, 0.262, 0.222), vec3f(0.098, 0.088, 0.080)), fine_slope(s, 0.62), 0.0);
  m = mix_in(m, rock, steeper(s, 0.93, 0.19));
  m = shore(m, s);
  // Snow: high, not too steep, lower on the north side and in hollows.
  let snow_line = 0.150 - 0.030 * clamp(s.n.y, -1.0, 1.0) - clamp(s.curvature, -0.4, 0.4) * 0.05 + (s.macro2.r - 0.5) * 0.040 + (s.fine1.r - 0.5) * 0.022;
  let snow = smoothstep(snow_line, snow_line + 0.014, s.height) * (1.0 - smoothstep(0.85, 1.35, s.steep + (s.fine1.g - 0.5) * 0.8));
  return mix_in(m, Material(vec3f(0.80, 0.83, 0.87), fine_slope(s, 0.10), 0.5), snow);
}
