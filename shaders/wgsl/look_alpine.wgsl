// Winter: snow wherever it can lie, bare rock where it cannot. One look_*.wgsl is part of the terrain module.
const SNOW_LINE: f32 = -0.05;
const TREE_LINE: f32 = 0.060;
const PLANTS: f32 = 1.0;

fn ground_material(s: Site) -> Material {
  let c = s.cover;
  var m = snowfield(s);
  // Trees carry snow: dark where the crowns are in the lee of each other.
  let gentle = (1.0 - smoothstep(0.62 * TREE_LINE, TREE_LINE, s.height)) * (1.0 - smoothstep(0.7, 1.0, s.steep));
  let stand = s.macro1.g * 0.48 + s.macro2.r * 0.42 + s.fine1.r * 0.14 + clamp(s.steep, 0.0, 0.6) * 0.2 + clamp(s.curvature, -0.1, 0.1) * 0.9;
  let wood = smoothstep(0.56, 0.64, stand + c.forest * 0.1) * gentle;
  let white = smoothstep(0.48, 0.80, s.fine1.g * 0.6 + s.fine2.r * 0.4);
  let crowns = Material(mix(vec3f(0.020, 0.032, 0.026), vec3f(0.36, 0.39, 0.43), white), fine_slope(s, 0.6), 0.1, 0.2);
  m = mix_in(m, crowns, wood * 0.94);
  // Snow keeps to ledges and gullies: beds and the fine relief decide.
  let beds = strata(s);
  let hold = (s.fine1.g - 0.5) * 0.70 + (s.fine2.r - 0.5) * 0.36 + (s.macro2.r - 0.5) * 0.3 + beds.z * 0.10 + beds.w * 0.08;
  let bare = smoothstep(0.80, 1.14, s.steep + hold - clamp(s.curvature, -0.3, 0.3) * 0.6);
  m = mix_in(m, rock(s, vec3f(0.235, 0.226, 0.220), vec3f(0.056, 0.056, 0.060), 0.8), bare);
  return shore(m, s, vec3f(0.40, 0.37, 0.33));
}
