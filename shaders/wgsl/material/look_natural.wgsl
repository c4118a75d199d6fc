// Meadows, woods, scree, rock and snow. One look_*.wgsl is part of the terrain module.
const STONE: vec3f = vec3f(0.196, 0.193, 0.187);

// What lies below faces: earth, stones, grass, woods. Only what is seen of it is made.
fn gentle_ground(s: Site) -> Material {
  let c = s.cover;
  let green = covered(c.grass, 0.16 + (s.macro2.r - 0.5) * 0.35 + (s.fine1.r - 0.5) * 0.16 + (s.fine2.r - 0.5) * 0.38 + (s.wide.r - 0.5) * 0.18 + (s.near.r - 0.5) * 0.14, 0.26);
  var m = bare_material();
  if (green < 1.0) {
    // Bare ground: stones high up, earth and short grass lower down.
    let stony = smoothstep(0.06, 0.13, s.height + (s.macro2.r - 0.5) * 0.05 + (s.fine2.r - 0.5) * 0.03);
    if (stony < 1.0) { m = earth(s, vec3f(0.158, 0.132, 0.092), vec3f(0.112, 0.084, 0.056)); }
    if (stony > 0.0) { m = laid(m, scree(s, STONE), stony); }
  }
  if (green > 0.0) {
    // Meadows: lush in hollows and low down, dry and pale on rises and higher up.
    let dry = smoothstep(0.25, 0.85, 0.45 + (s.macro1.r - 0.5) * 1.5 + (s.macro2.r - 0.5) * 0.8 + s.height * 3.0 - s.curvature * 0.5 - c.wet * 0.4);
    m = laid(m, meadow(s, vec3f(0.078, 0.098, 0.036), vec3f(0.182, 0.160, 0.086), dry), green);
  }
  let wood = covered(c.forest, (s.macro2.g - 0.5) * 0.55 + (s.fine1.g - 0.5) * 0.20 + (s.fine2.r - 0.5) * 0.35, 0.09) * afar(s);
  if (wood > 0.0) { m = mix_in(m, canopy(s, vec3f(0.018, 0.036, 0.016), vec3f(0.042, 0.060, 0.022)), wood); }
  return m;
}

fn ground_material(s: Site) -> Material {
  let c = s.cover;
  let snowy = scattered(c.snow, holds_snow(s));
  let rocky = steeper(s, 0.90, 0.17);
  // Rubble gathers below the faces, where the slope eases and hollows.
  let rubble = steeper(s, 0.70, 0.15) * (0.65 + 0.35 * smoothstep(-0.1, 0.2, s.curvature));
  var m = bare_material();
  if (rocky < 1.0) {
    if (rubble < 1.0) { m = gentle_ground(s); }
    if (rubble > 0.0) { m = laid(m, scree(s, STONE), rubble); }
  }
  if (rocky > 0.0) { m = laid(m, rock(s, vec3f(0.272, 0.270, 0.268), vec3f(0.052, 0.053, 0.056), 0.46), rocky); }
  m = soaked(m, c.wet * 0.7 * (1.0 - view.has_sea * step(s.shore, 0.003)));
  m = shore(m, s, vec3f(0.42, 0.355, 0.245));
  if (snowy > 0.0) { m = laid(m, snowfield(s), snowy); }
  return m;
}
