// A teaching model of cream paper. One look_*.wgsl is part of the terrain module.
fn ground_material(s: Site) -> Material {
  let grain = 0.97 + 0.05 * (s.fine2.r - 0.5) + 0.03 * (s.fine3.r - 0.5);
  return Material(vec3f(0.80, 0.705, 0.545) * grain, fine_slope(s, 0.02), 0.0);
}
