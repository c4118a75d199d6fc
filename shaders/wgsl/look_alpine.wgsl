// Winter: snow wherever it can lie, bare rock where it cannot. One look_*.wgsl is part of the terrain module.
fn ground_material(s: Site) -> Material {
  let snow_colour = vec3f(0.78, 0.81, 0.86) * (0.94 + 0.10 * s.macro2.r);
  var m = Material(snow_colour, fine_slope(s, 0.15), 0.5);
  let line = 0.075 + (s.macro1.g - 0.5) * 0.03;
  let trees = (1.0 - smoothstep(line * 0.6, line, s.height)) * (1.0 - smoothstep(0.7, 1.0, s.steep));
  let cover = s.macro1.g * 0.48 + s.macro2.r * 0.42 + s.fine1.r * 0.14 + clamp(s.steep, 0.0, 0.6) * 0.2 + clamp(s.curvature, -0.1, 0.1) * 0.9;
  let wood = smoothstep(0.56, 0.64, cover) * trees;
  let crown = mix(vec3f(0.026, 0.038, 0.030), vec3f(0.34, 0.37, 0.40), smoothstep(0.50, 0.78, s.fine1.g * 0.6 + s.fine2.r * 0.4));
  m = mix_in(m, Material(crown, fine_slope(s, 0.6), 0.1), wood * 0.92);
  let rock = Material(rock_colour(s, vec3f(0.215, 0.200, 0.190), vec3f(0.070, 0.068, 0.070)), fine_slope(s, 0.85), 0.0);
  // Snow keeps to ledges: the fine relief decides.
  let bare = smoothstep(0.78, 1.22, s.steep + (s.fine1.g - 0.5) * 0.62 + (s.fine2.r - 0.5) * 0.3 + (s.macro2.r - 0.5) * 0.3 + clamp(-s.curvature, -0.3, 0.3) * 0.6);
  m = mix_in(m, rock, bare);
  return shore(m, s);
}
