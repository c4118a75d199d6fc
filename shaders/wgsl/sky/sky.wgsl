// Reading the baked sky: radiance, ambient light by normal, aerial perspective.

fn paper_backdrop(dir: vec3f) -> vec3f {
  let t = clamp(dir.z * 0.8 + 0.35, 0.0, 1.0);
  return mix(vec3f(0.50, 0.455, 0.385), vec3f(0.70, 0.665, 0.61), t);
}

fn sky_colour(dir: vec3f) -> vec3f {
  if (view.look == LOOK_PAPER) { return paper_backdrop(dir); }
  // The mapping of sky/tables.wgsl, without a single arc function.
  let flat = max(length(dir.xy), 1.0e-5);
  let sun_flat = max(length(view.sun.xy), 1.0e-5);
  let azimuth = sqrt(clamp(0.5 - 0.5 * dot(dir.xy, view.sun.xy) / (flat * sun_flat), 0.0, 1.0));
  let elevation = sqrt(clamp(dir.z, 0.0, 1.0));
  let size = vec2f(textureDimensions(sky_lut));
  let uv = (vec2f(azimuth, elevation) * (size - 1.0) + 0.5) / size;
  return textureSampleLevel(sky_lut, smooth_clamp, uv, 0.0).rgb;
}

fn sun_light() -> vec3f {
  if (view.look == LOOK_PAPER) { return vec3f(2.80, 2.62, 2.32); }
  // A touch warmer than clear air makes it: morning haze.
  return skylight[6].rgb * vec3f(1.10, 1.0, 0.86);
}

// Diffuse light of sky and far ground on a surface with this normal (irradiance / pi).
fn ambient_light(n: vec3f) -> vec3f {
  if (view.look == LOOK_PAPER) { return mix(vec3f(0.16, 0.15, 0.14), vec3f(0.30, 0.315, 0.34), n.z * 0.5 + 0.5); }
  let q = n * n;
  let x = select(skylight[0].rgb, skylight[1].rgb, n.x < 0.0);
  let y = select(skylight[2].rgb, skylight[3].rgb, n.y < 0.0);
  let z = select(skylight[4].rgb, skylight[5].rgb, n.z < 0.0);
  return q.x * x + q.y * y + q.z * z;
}

// Extinction between the eye and a point at `distance` along `dir`: haze that thins out with height.
fn haze_depth(dir: vec3f, distance: f32) -> f32 {
  let scale = 0.13 * view.size;
  let k = dir.z / scale;
  let start = exp(-max(view.eye.z - view.low, -scale) / scale);
  let along = select((1.0 - exp(-clamp(k * distance, -20.0, 40.0))) / k, distance, abs(k * distance) < 1.0e-3);
  return view.haze * start * along;
}

// What the haze itself sends to the eye: the same sky that shows at the end of the sight, so that what is far melts into
// it, and a little of the blue above.
fn haze_glow(dir: vec3f) -> vec3f {
  let up = max(dir.z, 0.0);
  return mix(sky_colour(normalize(vec3f(dir.xy, up + 0.02))), sky_colour(normalize(vec3f(dir.xy, up + 0.30))), 0.42);
}

// The air between the eye and a point. It changes slowly, so passes with fine geometry take it at their vertices.
struct Air {
  through: vec3f,   // transmittance
  glow: vec3f,      // light that the air adds
};

fn air_to(p: vec3f) -> Air {
  if (view.eye.w > 0.5) { return Air(vec3f(1.0), vec3f(0.0)); }
  let dir = ray_to(p);
  // Droplets take all colours alike, the air itself takes blue most.
  let through = exp(-haze_depth(dir, distance(p, view.eye.xyz)) * vec3f(0.62, 0.90, 1.42));
  return Air(through, haze_glow(dir) * (vec3f(1.0) - through));
}
