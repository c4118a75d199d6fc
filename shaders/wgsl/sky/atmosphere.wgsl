// Scattering in the earth's atmosphere: Rayleigh, Mie and ozone with the coefficients of Hillaire, "A Scalable and
// Production Ready Sky and Atmosphere Rendering Technique" (2020), table 1. Kilometres inside. The result is baked into
// small tables (sky/tables.wgsl), so its cost does not matter.
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

// Light of all orders from the second on that comes from every side at once, for a sun of irradiance 1: Hillaire's
// Psi_ms (equations 5 to 10) over ground of albedo 0.3. The integral depends on altitude and the sun's height alone and
// is smooth in both, so it is a polynomial of exp(-z/8) and of the logarithm of the softened sine of the sun's height,
// fitted to the integral in double precision (tests/gpu/sky_twin.py; a test holds it within 10 % where the sun is up).
fn multiple_scattering(altitude: f32, sun_up: f32) -> vec3f {
  let s = log(0.5 * (sun_up + sqrt(sun_up * sun_up + 0.0064)));
  let z = exp(-altitude / 8.0);
  let a = vec3f(-3.1275, -3.1482, -3.0416) + s * (vec3f(0.6573, 0.5461, 0.3144) + s * (vec3f(-0.3458, -0.4405, -0.5261)
    + s * (vec3f(-0.2228, -0.2756, -0.3324) + s * vec3f(-0.0398, -0.0519, -0.0628))));
  let b = vec3f(0.2759, 0.6368, 1.1106) + s * (vec3f(-0.4424, -0.0234, 0.5996) + s * (vec3f(-0.8704, 0.0100, 1.1936)
    + s * (vec3f(-0.5050, -0.0509, 0.6892) + s * vec3f(-0.0924, -0.0262, 0.0950))));
  let c = vec3f(-0.0863, -0.3310, -0.7576) + s * (vec3f(0.4993, 0.2374, -0.1786) + s * (vec3f(0.8020, 0.1126, -0.9617)
    + s * (vec3f(0.4672, 0.1216, -0.5057) + s * vec3f(0.0826, 0.0338, -0.0637))));
  return exp(a + z * (b + z * c)) * smoothstep(-0.16, -0.06, sun_up);
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
    let scatter_r = RAYLEIGH * air.rayleigh;
    let scatter_m = vec3f(MIE_SCATTER * air.mie);
    let direct = air_transmittance(z, sun_up) * (scatter_r * phase_r + scatter_m * phase_m);
    let scattered = direct + multiple_scattering(z, sun_up) * (scatter_r + scatter_m);
    let step_through = exp(-extinction * length_km);
    radiance += through * scattered * (vec3f(1.0) - step_through) / max(extinction, vec3f(1.0e-7));
    through *= step_through;
  }
  return radiance * SUN_IRRADIANCE;
}
