// Sand, brush and banded sandstone. One look_*.wgsl is part of the terrain module.
fn ground_material(s: Site) -> Material {
  let sand = mix(vec3f(0.50, 0.335, 0.190), vec3f(0.58, 0.430, 0.270), s.macro1.r) * (0.90 + 0.20 * s.fine1.r);
  // Ripples across the wind, bent by the noise.
  let phase = dot(s.p.xy, vec2f(0.62, 0.78)) * 0.55 + s.fine1.r * 9.0 + s.macro2.r * 30.0;
  var m = Material(sand, fine_slope(s, 0.10) + ripple_slope(vec2f(0.62, 0.78), phase, pixel_size(s.p)), 0.0);
  let z = s.p.z + (s.macro2.r - 0.5) * view.size * 0.010 + (s.fine1.r - 0.5) * 5.0;
  let thick = fract(z * 27.0 / view.size);
  let thin = fract(z * 121.0 / view.size + 0.3);
  var bed = mix(vec3f(0.385, 0.185, 0.105), vec3f(0.50, 0.300, 0.180), smoothstep(0.25, 0.5, thick) - smoothstep(0.75, 1.0, thick));
  bed = mix(bed, vec3f(0.62, 0.47, 0.34), 0.45 * (smoothstep(0.62, 0.7, thin) - smoothstep(0.88, 0.96, thin)));
  let varnish = mix(vec3f(0.55), vec3f(1.05), clamp(s.fine1.g * 0.7 + s.fine2.g * 0.45, 0.0, 1.0));
  let rock = Material(bed * varnish, fine_slope(s, 0.75), 0.0);
  m = mix_in(m, rock, steeper(s, 0.56, 0.16));
  let brush = smoothstep(0.58, 0.70, s.fine1.g * 0.42 + s.fine2.r * 0.22 + s.macro2.r * 0.46) * (1.0 - smoothstep(0.2, 0.5, s.steep)) * 0.55;
  m = mix_in(m, Material(vec3f(0.135, 0.125, 0.060), fine_slope(s, 0.4), 0.0), brush);
  return shore(m, s);
}
