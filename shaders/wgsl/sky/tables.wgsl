// Bakes the sky into two small tables whenever the sun moves.
struct SkyJob {
  sun: vec4f,   // unit vector to the sun
};

const SKY_WIDTH: u32 = 64u;
const SKY_HEIGHT: u32 = 48u;

@group(0) @binding(0) var<uniform> job: SkyJob;
@group(0) @binding(1) var sky_out: texture_storage_2d<rgba16float, write>;
@group(0) @binding(2) var sky_in: texture_2d<f32>;
@group(0) @binding(3) var<storage, read_write> ambient_out: array<vec4f, 8>;

fn sun_axis() -> vec2f {
  let flat = length(job.sun.xy);
  return select(vec2f(1.0, 0.0), job.sun.xy / max(flat, 1.0e-6), flat > 1.0e-6);
}

// u: sine of half the azimuth away from the sun (the sky is symmetric); v: square root of the sine of the elevation.
fn direction_of(uv: vec2f) -> vec3f {
  let azimuth = 2.0 * asin(uv.x);
  let elevation = asin(uv.y * uv.y);
  let axis = sun_axis();
  let side = vec2f(-axis.y, axis.x);
  return vec3f((axis * cos(azimuth) + side * sin(azimuth)) * cos(elevation), sin(elevation));
}

@compute @workgroup_size(8, 8, 1)
fn bake_sky(@builtin(global_invocation_id) id: vec3u) {
  if (id.x >= SKY_WIDTH || id.y >= SKY_HEIGHT) { return; }
  let uv = vec2f(id.xy) / vec2f(f32(SKY_WIDTH - 1u), f32(SKY_HEIGHT - 1u));
  textureStore(sky_out, id.xy, vec4f(sky_radiance(direction_of(uv), job.sun.xyz), 1.0));
}

// Elements 0..5: irradiance / pi on faces +x, -x, +y, -y, +z, -z; 6: irradiance of the sun at the ground; 7: mean horizon.
@compute @workgroup_size(8, 1, 1)
fn bake_ambient(@builtin(global_invocation_id) id: vec3u) {
  if (id.x >= 8u) { return; }
  let lit = air_transmittance(VIEWER_KM, job.sun.z) * SUN_IRRADIANCE;
  if (id.x == 6u) {
    ambient_out[6] = vec4f(lit, 1.0);
    return;
  }
  let face = vec3f(
    select(0.0, select(1.0, -1.0, (id.x & 1u) == 1u), id.x / 2u == 0u),
    select(0.0, select(1.0, -1.0, (id.x & 1u) == 1u), id.x / 2u == 1u),
    select(0.0, select(1.0, -1.0, (id.x & 1u) == 1u), id.x / 2u == 2u));
  var sum = vec3f(0.0);
  var weight = 0.0;
  var overhead = vec3f(0.0);
  var overhead_weight = 0.0;
  for (var j = 0u; j < SKY_HEIGHT; j += 2u) {
    for (var i = 0u; i < 2u * SKY_WIDTH; i += 2u) {
      let mirrored = select(i, 2u * SKY_WIDTH - 1u - i, i >= SKY_WIDTH);
      let uv = vec2f(f32(mirrored), f32(j)) / vec2f(f32(SKY_WIDTH - 1u), f32(SKY_HEIGHT - 1u));
      var dir = direction_of(uv);
      if (i >= SKY_WIDTH) {
        let axis = sun_axis();
        dir = vec3f(2.0 * axis * dot(axis, dir.xy) - dir.xy, dir.z);
      }
      // Solid angle of a texel: d(azimuth) d(sine of elevation).
      let solid = uv.y / sqrt(max(1.0 - uv.x * uv.x, 0.004)) + 1.0e-4;
      let value = textureLoad(sky_in, vec2u(mirrored, j), 0).rgb;
      let c = max(0.0, dot(dir, face)) * solid;
      sum += value * c;
      // What the lower half sees is ground: it sends back a fifth of what falls on it.
      weight += max(0.0, abs(dot(dir, face))) * solid;
      overhead += value * dir.z * solid;
      overhead_weight += dir.z * solid;
      if (id.x == 7u && j < 4u) {
        sum += value * 1.0;
        weight += 1.0;
      }
    }
  }
  if (id.x == 7u) {
    ambient_out[7] = vec4f(sum / weight, 1.0);
    return;
  }
  let above = overhead / overhead_weight;
  let below = 0.18 * (above + lit * max(job.sun.z, 0.0) / 3.14159265);
  // Part of the face's hemisphere that lies below the horizon.
  let ground_part = select(0.5, select(0.0, 1.0, face.z < -0.5), abs(face.z) > 0.5);
  let sky = select(sum / max(weight, 1.0e-4), vec3f(0.0), face.z < -0.5);
  ambient_out[id.x] = vec4f(sky * (1.0 - ground_part) * select(2.0, 1.0, abs(face.z) > 0.5) + below * ground_part, 1.0);
}
