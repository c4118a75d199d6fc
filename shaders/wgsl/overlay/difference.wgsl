// How far the ground is from the target of a task: 0 far too low, 0.5 as it is asked for, 1 far too high. Blue and red keep
// apart for who sees red and green alike. The map and the legend have the same colours (frontend/src/core/difference.ts).
fn difference_tint(albedo: vec3f, off: f32) -> vec3f {
  let grey = vec3f(dot(albedo, vec3f(0.2126, 0.7152, 0.0722))) * 0.8 + vec3f(0.05);
  let far = 2.0 * off - 1.0;
  let tint = select(vec3f(0.012, 0.13, 0.62), vec3f(0.66, 0.022, 0.016), far > 0.0);
  return mix(grey, tint * (0.45 + 1.5 * grey), 0.88 * smoothstep(0.02, 0.75, abs(far)));
}
