// Meadows, woods, scree, rock and snow. One look_*.wgsl is part of the terrain module.
fn ground_material(s: Site) -> Material {
  let c = s.cover;
  // Bare ground: stones high up, earth and short grass lower down.
  let stony = scree(s, vec3f(0.250, 0.232, 0.205));
  let earth = heaped(Material(mix(vec3f(0.150, 0.128, 0.088), vec3f(0.120, 0.088, 0.056), s.fine1.r) * (0.8 + 0.4 * s.fine2.r), fine_slope(s, 0.20), 0.0, 0.0), s, 0.7);
  var m = mix_in(earth, stony, smoothstep(0.06, 0.13, s.height + (s.macro2.r - 0.5) * 0.05));
  // Meadows: lush in hollows and low down, dry and pale on rises and higher up.
  let dry = smoothstep(0.25, 0.85, 0.45 + (s.macro1.r - 0.5) * 1.5 + (s.macro2.r - 0.5) * 0.8 + s.height * 3.0 - s.curvature * 0.5 - c.wet * 0.4);
  let tone = 0.86 + 0.16 * (s.fine1.r - 0.5) + 0.40 * (s.fine2.r - 0.5) + 0.25 * (s.fine3.r - 0.5) + 0.25 * (s.macro2.g - 0.5);
  let meadow = Material(mix(vec3f(0.078, 0.122, 0.030), vec3f(0.205, 0.192, 0.080), dry) * tone, fine_slope(s, 0.13), 0.0, 0.12);
  let green = covered(c.grass, 0.16 + (s.macro2.r - 0.5) * 0.35 + (s.fine1.r - 0.5) * 0.16 + (s.fine2.r - 0.5) * 0.3 + (s.fine3.r - 0.5) * 0.35, 0.24);
  m = mix_in(m, tufted(meadow, s, vec3f(0.250, 0.232, 0.205)), green);
  let wood = covered(c.forest, (s.macro2.g - 0.5) * 0.55 + (s.fine1.g - 0.5) * 0.20 + (s.fine2.r - 0.5) * 0.35, 0.09);
  m = mix_in(m, canopy(s, vec3f(0.018, 0.036, 0.015), vec3f(0.044, 0.062, 0.020)), wood * afar(s));
  // Rubble gathers below the faces, where the slope eases and hollows.
  m = mix_in(m, stony, steeper(s, 0.70, 0.15) * (0.65 + 0.35 * smoothstep(-0.1, 0.2, s.curvature)));
  m = mix_in(m, rock(s, vec3f(0.282, 0.276, 0.266), vec3f(0.052, 0.052, 0.056), 0.46), steeper(s, 0.90, 0.17));
  m = soaked(m, c.wet * 0.7 * (1.0 - view.has_sea * step(s.shore, 0.003)));
  m = shore(m, s, vec3f(0.42, 0.355, 0.245));
  return mix_in(m, snowfield(s), covered(c.snow, (s.fine2.r - 0.5) * 0.4 + (s.fine1.g - 0.5) * 0.3, 0.20));
}
