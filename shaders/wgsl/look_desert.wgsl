// Sand, brush and banded sandstone. One look_*.wgsl is part of the terrain module.
fn ground_material(s: Site) -> Material {
  let c = s.cover;
  let sand = mix(vec3f(0.47, 0.300, 0.160), vec3f(0.56, 0.405, 0.245), s.macro1.r) * (0.88 + 0.16 * s.fine1.r + 0.10 * s.fine3.r);
  // Ripples across the wind, bent by the noise.
  let phase = dot(s.p.xy, vec2f(0.62, 0.78)) * 0.55 + s.fine1.r * 9.0 + s.macro2.r * 30.0;
  var m = Material(sand, fine_slope(s, 0.09) + ripple_slope(vec2f(0.62, 0.78), phase, s.footprint), 0.0, 0.1);
  // Broken rock in fans below the walls.
  m = mix_in(m, scree(s, vec3f(0.43, 0.255, 0.150)), steeper(s, 0.40, 0.12) * 0.8);
  // The great beds lie flat: bands of red, rust and pale stone, hard ones as cliffs.
  let z = s.p.z + (s.macro2.r - 0.5) * view.size * 0.008 + (s.fine1.r - 0.5) * 5.0;
  let thick = fract(z * 27.0 / view.size);
  let thin = fract(z * 121.0 / view.size + 0.3);
  let blur = clamp(s.footprint * 60.0 / view.size, 0.02, 0.25);
  var bed = mix(vec3f(0.335, 0.140, 0.075), vec3f(0.47, 0.265, 0.150), smoothstep(0.25, 0.25 + blur + 0.15, thick) - smoothstep(0.80, 1.0, thick));
  bed = mix(bed, vec3f(0.61, 0.455, 0.315), 0.45 * (smoothstep(0.60, 0.68 + blur, thin) - smoothstep(0.86, 0.94 + blur, thin)) * (1.0 - smoothstep(0.12, 0.25, blur)));
  let varnish = mix(vec3f(0.50), vec3f(1.08), clamp(s.fine1.g * 0.75 + s.fine2.g * 0.45, 0.0, 1.0));
  let ledge = s.n.xy * (cos(6.2831853 * thick) * 0.20 + cos(6.2831853 * thin) * 0.12 * (1.0 - smoothstep(0.10, 0.2, blur))) * min(s.steep, 1.0);
  m = mix_in(m, Material(bed * varnish, fine_slope(s, 0.62) + ledge, 0.0, 0.0), steeper(s, 0.56, 0.13));
  let brush = smoothstep(0.58, 0.70, s.fine1.g * 0.42 + s.fine2.r * 0.22 + s.macro2.r * 0.46) * (1.0 - smoothstep(0.2, 0.5, s.steep)) * 0.55;
  m = mix_in(m, Material(vec3f(0.118, 0.112, 0.052), fine_slope(s, 0.4), 0.0, 0.1), max(brush, 0.7 * covered(c.grass, (s.fine2.r - 0.5) * 0.5, 0.2)));
  m = mix_in(m, canopy(s, vec3f(0.030, 0.040, 0.016), vec3f(0.070, 0.075, 0.028)), covered(c.forest, (s.fine1.g - 0.5) * 0.4, 0.15));
  m = mix_in(m, snowfield(s), covered(c.snow, (s.fine2.r - 0.5) * 0.4, 0.2));
  m = soaked(m, c.wet * 0.8 * (1.0 - view.has_sea * step(s.shore, 0.003)));
  return shore(m, s, vec3f(0.52, 0.40, 0.26));
}
