// A teaching model of stacked card. One look_*.wgsl is part of the terrain module.
fn ground_material(s: Site) -> Material {
  let grain = 0.98 + 0.03 * (s.fine2.r - 0.5) + 0.05 * (s.wide.r - 0.5) + 0.09 * (s.near.r - 0.5);
  // Each contour is the edge of a sheet: a soft shade at its foot, a light rim at its top.
  let z = s.p.z / view.contour - 0.01;
  let up = fract(z);
  let seen = 1.0 - smoothstep(0.10, 0.35, s.footprint * min(s.steep, 1.0) / view.contour);
  let flat = smoothstep(0.01, 0.06, s.steep);
  let edge = seen * flat * (0.10 * smoothstep(0.12, 0.0, up) - 0.17 * smoothstep(0.55, 1.0, up));
  // Sheets alternate by a hair, as cut from different rolls.
  let roll = 1.0 + 0.018 * seen * cos(6.2831853 * (floor(z) * 0.381966));
  return Material(vec3f(0.80, 0.715, 0.570) * grain * roll * (1.0 + edge), fine_relief(s, 0.06), 0.0, 0.35, 1.0, 0.5);
}
