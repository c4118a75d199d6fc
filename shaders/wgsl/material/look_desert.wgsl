// Sand, brush and banded sandstone. One look_*.wgsl is part of the terrain module.

// The great beds lie flat: bands of red, rust and pale stone, hard ones as cliffs.
fn sandstone(s: Site) -> Material {
  let z = s.p.z + (s.macro2.r - 0.5) * view.size * 0.008 + (s.fine1.r - 0.5) * 5.0 + (s.fine2.r - 0.5) * 1.6;
  let thick = fract(z * 27.0 / view.size);
  let thin = fract(z * 121.0 / view.size + 0.3);
  // Laminae of a hand's breadth show where the eye is near.
  let leaf = fract(z * 2.9 + s.fine2.g * 2.0);
  let leaves = smoothstep(0.09, 0.03, s.footprint);
  let blur = clamp(s.footprint * 60.0 / view.size, 0.02, 0.25);
  var bed = mix(vec3f(0.335, 0.140, 0.075), vec3f(0.47, 0.265, 0.150), smoothstep(0.25, 0.25 + blur + 0.15, thick) - smoothstep(0.80, 1.0, thick));
  bed = mix(bed, vec3f(0.61, 0.455, 0.315), 0.45 * (smoothstep(0.60, 0.68 + blur, thin) - smoothstep(0.86, 0.94 + blur, thin)) * (1.0 - smoothstep(0.12, 0.25, blur)));
  bed *= 1.0 + leaves * 0.16 * (smoothstep(0.0, 0.3, leaf) - smoothstep(0.7, 1.0, leaf) - 0.4);
  // Desert varnish: dark stains that run down from the rims.
  let stain = smoothstep(0.52, 0.78, s.fine1.g * 0.6 + s.fine2.g * 0.4);
  let tone = 0.74 + 0.24 * (s.fine2.r - 0.5) + 0.24 * (s.wide.r - 0.5) + 0.46 * s.near.r;
  let step = cos(6.2831853 * thick) * 0.20 + cos(6.2831853 * thin) * 0.12 * (1.0 - smoothstep(0.10, 0.2, blur)) + leaves * 0.10 * cos(6.2831853 * leaf);
  let ledge = vec3f(0.0, 0.0, -step * min(s.steep, 1.0));
  let m = Material(bed * tone * mix(vec3f(1.0), vec3f(0.52, 0.50, 0.52), 0.75 * stain), fine_relief(s, 0.50) + ledge, 0.0, 0.0,
    mix(0.75, 1.0, s.near.r), 0.35 + 0.4 * s.near.r + 0.3 * thick);
  return broken(m, s, 0.75);
}

// Between the walls: sand, pavements of stones, fans of broken rock, dry brush in tussocks.
fn gentle_ground(s: Site) -> Material {
  let c = s.cover;
  var m = sand(s, mix(vec3f(0.47, 0.300, 0.160), vec3f(0.56, 0.405, 0.245), s.macro1.r));
  let paved = 0.75 * smoothstep(0.50, 0.68, s.fine1.g * 0.45 + s.fine2.g * 0.30 + s.macro2.r * 0.25);
  let fans = steeper(s, 0.40, 0.12) * 0.85;
  if (max(paved, fans) > 0.0) {
    m = laid(m, scree(s, mix(vec3f(0.40, 0.262, 0.165), vec3f(0.43, 0.245, 0.140), step(paved, fans))), max(paved, fans));
  }
  let brush = smoothstep(0.58, 0.70, s.fine1.g * 0.42 + s.fine2.r * 0.30 + s.macro2.r * 0.38) * (1.0 - smoothstep(0.2, 0.5, s.steep)) * 0.60;
  let grown = max(brush, 0.7 * covered(c.grass, (s.fine2.r - 0.5) * 0.6, 0.3));
  if (grown > 0.0) { m = laid(m, meadow(s, vec3f(0.118, 0.112, 0.060), vec3f(0.185, 0.150, 0.080), 0.5), grown); }
  let wood = covered(c.forest, (s.fine1.g - 0.5) * 0.4, 0.15) * afar(s);
  if (wood > 0.0) { m = mix_in(m, canopy(s, vec3f(0.030, 0.040, 0.016), vec3f(0.070, 0.075, 0.028)), wood); }
  return m;
}

fn ground_material(s: Site) -> Material {
  let c = s.cover;
  let walls = steeper(s, 0.56, 0.13);
  var m = bare_material();
  if (walls < 1.0) { m = gentle_ground(s); }
  if (walls > 0.0) { m = laid(m, sandstone(s), walls); }
  let snowy = scattered(c.snow, holds_snow(s));
  if (snowy > 0.0) { m = laid(m, snowfield(s), snowy); }
  m = soaked(m, c.wet * 0.8 * (1.0 - view.has_sea * step(s.shore, 0.003)));
  return shore(m, s, vec3f(0.52, 0.40, 0.26));
}
