// Behind everything: sky, the sun's disc, thin cloud, and the plane on which the block stands or the open sea.
struct BackgroundVertex {
  @builtin(position) position: vec4f,
  @location(0) ndc: vec2f,
};

@vertex
fn background_vertex(@builtin(vertex_index) index: u32) -> BackgroundVertex {
  let ndc = vec2f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
  return BackgroundVertex(vec4f(ndc, 0.0, 1.0), ndc);
}

fn clouds(dir: vec3f, base: vec3f) -> vec3f {
  if (view.look == LOOK_PAPER || dir.z < 0.02) { return base; }
  // Two thin sheets, stretched by the wind.
  let at = dir.xy / (dir.z + 0.12);
  let a = textureSampleLevel(noise, smooth_repeat, at * vec2f(0.055, 0.11) + 0.13, 0.0);
  let b = textureSampleLevel(noise, smooth_repeat, at * vec2f(0.16, 0.27) + 0.61, 1.0);
  let amount = smoothstep(0.50, 0.86, a.r * 0.72 + b.r * 0.34) * smoothstep(0.02, 0.22, dir.z);
  let towards = max(dot(dir, view.sun.xyz), 0.0);
  let lit = sun_light() * (0.055 + 0.16 * pow(towards, 8.0)) + base * 0.75;
  return mix(base, lit, amount * 0.5);
}

fn sky_with_sun(dir: vec3f) -> vec3f {
  var colour = clouds(dir, sky_colour(dir));
  if (view.look != LOOK_PAPER) {
    // The low sun's warmth over the horizon, all round.
    let early = 1.0 - smoothstep(0.10, 0.62, view.sun.z);
    colour += sun_light() * vec3f(0.062, 0.034, 0.014) * (early * exp(-max(dir.z, 0.0) * 11.0));
    let c = dot(dir, view.sun.xyz);
    let disc = smoothstep(0.99996, 0.999985, c) * smoothstep(-0.02, 0.0, dir.z);
    colour += sun_light() * (disc * 40.0 + pow(max(c, 0.0), 900.0) * 0.5 + pow(max(c, 0.0), 60.0) * 0.03);
  }
  return colour;
}

fn plane_albedo() -> vec3f {
  switch (view.look) {
    case LOOK_ALPINE: { return vec3f(0.56, 0.59, 0.63); }
    case LOOK_DESERT: { return vec3f(0.44, 0.315, 0.195); }
    case LOOK_PAPER: { return vec3f(0.50, 0.455, 0.385); }
    default: { return vec3f(0.098, 0.126, 0.060); }
  }
}

struct Country {
  albedo: vec3f,
  slope: vec2f,   // of its hills
};

// A layer of noise over the country, blurred as far as a pixel reaches. `wide`: in sides of the domain.
fn country_noise(p: vec2f, footprint: f32, wide: f32, turn: vec2f) -> vec4f {
  let scale = view.size * wide;
  let n = textureSampleLevel(noise, smooth_repeat, turned(p, turn) / scale, clamp(log2(max(footprint, 1.0e-3) * 256.0 / scale), 0.0, 8.0));
  let g = n.ba - 0.5;
  return vec4f(n.rg, vec2f(g.x * turn.x + g.y * turn.y, g.y * turn.x - g.x * turn.y) + 0.5);
}

// Far country: rolling land with woods in its folds, meadows and fields, snow or dunes. The layers are bent by the broadest, so
// that none is seen to repeat.
fn country(p: vec2f, footprint: f32, away: f32) -> Country {
  let broad = country_noise(p, footprint, 3.7, vec2f(0.917, -0.399));
  let bent = p + (broad.rg - 0.5) * (0.30 * view.size);
  let hills = country_noise(bent, footprint, 1.13, vec2f(0.602, 0.799));
  let folds = country_noise(bent.yx + (hills.rg - 0.5) * (0.06 * view.size), footprint, 0.31, vec2f(0.829, 0.559));
  // It is level beside the block, whatever lies there.
  let rise = smoothstep(0.03 * view.size, 0.9 * view.size, away);
  var slope = (noise_slope(broad) * 0.05 + noise_slope(hills) * 0.085 + noise_slope(folds).yx * 0.05) * rise;
  let trees = country_noise(bent, footprint, 0.083, vec2f(0.669, -0.743));
  let wood = smoothstep(0.46, 0.58, hills.g * 0.34 + folds.r * 0.34 + broad.r * 0.16 + trees.r * 0.16);
  let open = plane_albedo() * (0.80 + 0.34 * hills.r + 0.30 * (folds.g - 0.3));
  switch (view.look) {
    case LOOK_ALPINE: { return Country(mix(open, vec3f(0.085, 0.098, 0.100), wood * 0.72), slope); }
    case LOOK_DESERT: {
      // Dunes, and pavements of dark stone.
      let dunes = country_noise(bent * vec2f(1.0, 0.42), footprint, 0.12, vec2f(0.669, 0.743));
      slope += noise_slope(dunes) * 0.07;
      return Country(mix(open, open * vec3f(0.62, 0.53, 0.50), wood * 0.55), slope);
    }
    case LOOK_PAPER: { return Country(plane_albedo(), vec2f(0.0)); }
    default: {
      let dry = smoothstep(0.42, 0.62, folds.r * 0.5 + broad.g * 0.5);
      let meadows = mix(open, vec3f(0.205, 0.178, 0.088) * (0.8 + 0.4 * hills.r), 0.38 * dry);
      return Country(mix(meadows, vec3f(0.034, 0.052, 0.028) * (0.75 + 0.5 * folds.g), wood * 0.88), slope);
    }
  }
}

fn ground_plane(p: vec3f, dir: vec3f, footprint: f32) -> vec3f {
  let away = outside_domain(p.xy);
  // Contact shade round the block, and its soft shadow away from the sun.
  let shade = 1.0 - 0.45 * exp(-away / (0.025 * view.size)) - 0.12 * exp(-away / (0.12 * view.size));
  let tall = 0.5 * (view.low + view.high) - view.base;
  let reach = tall * length(view.sun.xy) / max(view.sun.z, 0.12);
  let toward = p.xy + normalize(view.sun.xy + vec2f(1.0e-5)) * min(reach, view.size) * 0.5;
  let shadow = smoothstep(0.0, 0.5 * min(reach, view.size) + 1.0, outside_domain(toward));
  let land = country(p.xy, footprint, away);
  let n = normalize(vec3f(-land.slope, 1.0));
  let beam = sun_light() * (mix(0.45, 1.0, shadow) / 3.14159265);
  let sun = beam * max(view.sun.z, 0.0);
  let sky = ambient_light(vec3f(0.0, 0.0, 1.0));
  var colour = land.albedo * (beam * max(dot(n, view.sun.xyz), 0.0) + sky) * max(shade, 0.0);
  if (view.look != LOOK_PAPER) {
    // Morning mist lies in the lowlands while the sun is low; it starts a way off the block.
    let drift = textureSampleLevel(noise, smooth_repeat, turned(p.xy, vec2f(0.829, 0.559)) / (view.size * 7.9), clamp(log2(max(footprint, 1.0e-3) * 256.0 / (view.size * 7.9)), 0.0, 8.0));
    let early = 1.0 - smoothstep(0.10, 0.62, view.sun.z);
    let mist = early * smoothstep(0.34, 0.80, drift.r + 0.30 * smoothstep(0.4 * view.size, 3.0 * view.size, away)) * smoothstep(0.12 * view.size, 2.4 * view.size, away);
    let towards = max(dot(dir, view.sun.xyz), 0.0);
    colour = mix(colour, (1.50 * sun + 2.4 * sky) + sun_light() * 0.06 * pow(towards, 6.0), mist * 0.84);
  }
  return colour;
}

// Silhouettes of far ranges on the horizon, paler the further they are.
fn far_ranges(dir: vec3f, sky: vec3f) -> vec3f {
  if (view.look == LOOK_PAPER || view.has_sea > 0.5 || dir.z > 0.10) { return sky; }
  let azimuth = atan2(dir.y, dir.x) / 6.2831853;
  let glow = haze_glow(dir);
  let light = sun_light() * 0.10 + ambient_light(vec3f(0.0, 0.0, 1.0)) * 0.8;
  let snowy = select(0.0, 0.5, view.look == LOOK_ALPINE);
  var colour = sky;
  for (var i = 0; i < 3; i += 1) {
    let k = f32(i);
    let a = textureSampleLevel(noise, smooth_repeat, vec2f(azimuth * (3.0 + k), 0.13 + 0.29 * k), 0.0);
    let b = textureSampleLevel(noise, smooth_repeat, vec2f(azimuth * (9.0 + 2.0 * k), 0.71 - 0.17 * k), 0.0);
    let top = (0.056 - 0.016 * k) * (0.20 + 0.60 * a.g + 0.50 * a.r * b.g) - 0.004;
    let inside = 1.0 - smoothstep(top - 0.0007, top + 0.0007, dir.z);
    let high = smoothstep(0.4, 0.9, dir.z / max(top, 1.0e-3) + (b.r - 0.5) * 0.5) * (1.0 - 0.4 * k);
    let body = mix(plane_albedo() * 0.55, vec3f(0.62, 0.66, 0.72), high * max(snowy, 0.35 * f32(view.look == LOOK_NATURAL))) * light;
    // Mist fills the valleys between the ranges.
    let mist = mix(0.90 - 0.11 * k, 1.0, 1.0 - smoothstep(-0.006, 0.6 * top + 0.004, dir.z));
    colour = mix(colour, mix(body, glow, mist), inside);
  }
  return colour;
}

@fragment
fn background_fragment(v: BackgroundVertex) -> @location(0) vec4f {
  let dir = ray_through(v.ndc);
  let pixel = v.position.xy;
  if (view.eye.w > 0.5) {
    // The map lies on a plain sheet.
    return display(plane_albedo() * (ambient_light(vec3f(0.0, 0.0, 1.0)) + sun_light() * 0.12), pixel);
  }
  var colour = far_ranges(dir, sky_with_sun(dir));
  let level = select(view.base, view.sea, view.has_sea > 0.5);
  let down = view.eye.z - level;
  if (dir.z < -1.0e-4 && down > 0.0) {
    let distance = down / -dir.z;
    let p = view.eye.xyz + dir * distance;
    if (view.has_sea > 0.5) {
      colour = open_water(p, dir);
    } else {
      colour = ground_plane(p, dir, pixel_size(p) / max(-dir.z, 0.02));
    }
    let air = air_to(p);
    colour = colour * air.through + air.glow;
  }
  return display(colour, pixel);
}
