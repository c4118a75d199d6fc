// Single scattering in the earth's atmosphere: Rayleigh, Mie and ozone with the coefficients of Hillaire, "A Scalable and
// Production Ready Sky and Atmosphere Rendering Technique" (2020), table 1. Kilometres inside. The result is baked into
// small tables (compute_sky.wgsl), so its cost does not matter.
const PLANET_KM: f32 = 6360.0;
const TOP_KM: f32 = 6460.0;
const VIEWER_KM: f32 = 0.6;
const SUN_IRRADIANCE: f32 = 10.0;
const RAYLEIGH: vec3f = vec3f(5.802e-3, 13.558e-3, 33.1e-3);
const MIE_SCATTER: f32 = 3.996e-3;
const MIE_EXTINCTION: f32 = 8.396e-3;
const OZONE: vec3f = vec3f(0.650e-3, 1.881e-3, 0.085e-3);

struct AirDensity {
  rayleigh: f32,
  mie: f32,
  ozone: f32,
};

fn air_at(altitude: f32) -> AirDensity {
  let z = max(altitude, 0.0);
  return AirDensity(exp(-z / 8.0), exp(-z / 1.2), max(0.0, 1.0 - abs(z - 25.0) / 15.0));
}

fn air_extinction(a: AirDensity) -> vec3f {
  return RAYLEIGH * a.rayleigh + vec3f(MIE_EXTINCTION) * a.mie + OZONE * a.ozone;
}

// Distance to the top of the atmosphere from altitude along a direction with sine of elevation `up`.
fn to_top(altitude: f32, up: f32) -> f32 {
  let r = PLANET_KM + altitude;
  return -r * up + sqrt(max(0.0, r * r * (up * up - 1.0) + TOP_KM * TOP_KM));
}

fn altitude_along(altitude: f32, up: f32, t: f32) -> f32 {
  let r = PLANET_KM + altitude;
  return sqrt(r * r + t * t + 2.0 * r * t * up) - PLANET_KM;
}

fn air_transmittance(altitude: f32, up: f32) -> vec3f {
  let reach = to_top(altitude, up);
  var depth = vec3f(0.0);
  const N = 16;
  for (var i = 0; i < N; i += 1) {
    // Quadratic spacing: the air is dense near the start.
    let a = f32(i) / f32(N);
    let b = f32(i + 1) / f32(N);
    let t = reach * 0.5 * (a * a + b * b);
    depth += air_extinction(air_at(altitude_along(altitude, up, t))) * reach * (b * b - a * a);
  }
  // The planet's shadow, softened over the disc of the sun.
  let horizon = -sqrt(max(0.0, 1.0 - pow(PLANET_KM / (PLANET_KM + altitude + 0.001), 2.0)));
  return exp(-depth) * smoothstep(horizon - 0.02, horizon + 0.02, up);
}

fn rayleigh_phase(c: f32) -> f32 {
  return 3.0 / (16.0 * 3.14159265) * (1.0 + c * c);
}

// Cornette and Shanks.
fn mie_phase(c: f32, g: f32) -> f32 {
  let k = 3.0 / (8.0 * 3.14159265) * (1.0 - g * g) / (2.0 + g * g);
  return k * (1.0 + c * c) / pow(max(1.0e-4, 1.0 + g * g - 2.0 * g * c), 1.5);
}

// Radiance of the sky along `dir` (dir.z >= 0) with the sun at `sun`.
fn sky_radiance(dir: vec3f, sun: vec3f) -> vec3f {
  let up = max(dir.z, 0.0);
  let reach = to_top(VIEWER_KM, up);
  let c = dot(dir, sun);
  let phase_r = rayleigh_phase(c);
  let phase_m = mie_phase(c, 0.78);
  var through = vec3f(1.0);
  var radiance = vec3f(0.0);
  const N = 24;
  for (var i = 0; i < N; i += 1) {
    let a = f32(i) / f32(N);
    let b = f32(i + 1) / f32(N);
    let t = reach * 0.5 * (a * a + b * b);
    let length_km = reach * (b * b - a * a);
    let z = altitude_along(VIEWER_KM, up, t);
    let air = air_at(z);
    let extinction = air_extinction(air);
    // The local vertical turns along the ray.
    let r = PLANET_KM + z;
    let sun_up = (sun.z * (PLANET_KM + VIEWER_KM) + t * c) / r;
    let lit = air_transmittance(z, sun_up);
    let single = lit * (RAYLEIGH * air.rayleigh * phase_r + vec3f(MIE_SCATTER * air.mie * phase_m));
    // Further orders, taken as isotropic: what reaches this height, scattered again.
    let again = (lit * 0.5 + 0.12 * smoothstep(-0.15, 0.2, sun.z)) * (RAYLEIGH * air.rayleigh + vec3f(MIE_SCATTER * air.mie)) * 0.055;
    let step_through = exp(-extinction * length_km);
    let scattered = (single + again) * (vec3f(1.0) - step_through) / max(extinction, vec3f(1.0e-7));
    radiance += through * scattered;
    through *= step_through;
  }
  return radiance * SUN_IRRADIANCE;
}
