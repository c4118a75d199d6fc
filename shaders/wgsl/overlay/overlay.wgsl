// Lines and tints over the ground: contours, slope, patches, the scale grid, cursors. All are anti-aliased by the
// pixel's footprint and fade out before they could become moire.

// `share`: how far contours show here; they fade on ground that is flat without its detail (frontend/src/tiles/flat.ts).
fn contours(height: f32, rate: f32, share: f32) -> f32 {
  // A hair above the round value: ground that is flat at exactly that height is not one wide line.
  let z = height - 0.01 * view.contour;
  let minor = lines(z, view.contour, rate, 0.35 * view.line_scale) * 0.5;
  let major = lines(z, view.contour * 5.0, rate, 0.7 * view.line_scale);
  return max(minor, major) * share;
}

// Contours in ink: brown on the paper model, else the ground's own colour, darker.
fn inked(colour: vec3f, cover: f32) -> vec3f {
  let ink = select(colour * 0.22, colour * vec3f(0.42, 0.27, 0.17), view.look == LOOK_PAPER);
  return mix(colour, ink, cover);
}

// A sixteenth of the domain, so that a first look reads scale and perspective.
fn scale_grid(p: vec2f, f: Footprint) -> f32 {
  let rate = abs(f.dx.xy) + abs(f.dy.xy);
  let every = view.size / 16.0;
  let fine = max(lines(p.x, every, rate.x, 0.35), lines(p.y, every, rate.y, 0.35));
  let coarse = max(lines(p.x, every * 4.0, rate.x, 0.6), lines(p.y, every * 4.0, rate.y, 0.6));
  return max(fine * 0.55, coarse);
}

fn slope_tint(steep: f32) -> vec3f {
  let degrees = atan(steep) * 57.29578;
  let a = mix(vec3f(0.16, 0.42, 0.22), vec3f(0.80, 0.72, 0.16), smoothstep(5.0, 25.0, degrees));
  let b = mix(a, vec3f(0.78, 0.22, 0.08), smoothstep(25.0, 40.0, degrees));
  return mix(b, vec3f(0.36, 0.05, 0.22), smoothstep(40.0, 60.0, degrees));
}

// Roughness from smooth to rough by hue, noise amplitude by strength. The legend in ui/panels/legend.ts has the same colours.
fn detail_tint(detail: vec2f) -> vec3f {
  let smooth_half = mix(vec3f(0.05, 0.24, 0.40), vec3f(0.46, 0.40, 0.16), clamp(detail.y * 2.0, 0.0, 1.0));
  let hue = mix(smooth_half, vec3f(0.52, 0.06, 0.10), clamp(detail.y * 2.0 - 1.0, 0.0, 1.0));
  return mix(vec3f(0.30), hue, 0.25 + 0.75 * sqrt(detail.x));
}

// Where the selected stroke is felt: warm on its line and flanks, paling with distance; the rest of the ground goes grey.
fn influence_tint(albedo: vec3f, felt: f32) -> vec3f {
  let grey = vec3f(dot(albedo, vec3f(0.2126, 0.7152, 0.0722))) * 0.75 + vec3f(0.03);
  let tint = mix(vec3f(0.48, 0.40, 0.14), vec3f(0.62, 0.11, 0.05), smoothstep(0.35, 1.0, felt));
  let bands = smoothstep(0.47, 0.53, felt) * 0.12;
  return mix(grey, tint * (0.45 + 1.6 * grey), clamp(smoothstep(0.02, 0.5, felt) * 0.72 + bands, 0.0, 0.9));
}

// The ground that drains through a place: washed in blue; what lies beyond pales a little.
fn watershed_tint(albedo: vec3f, share: f32) -> vec3f {
  let grey = vec3f(dot(albedo, vec3f(0.2126, 0.7152, 0.0722)));
  let inside = albedo * vec3f(0.42, 0.62, 0.78) + vec3f(0.012, 0.045, 0.115);
  return mix(mix(albedo, grey, 0.35), inside, smoothstep(0.25, 0.75, share) * 0.85);
}

// A painted channel: 0 took all of it away, 0.5 left it as it grows, 1 asked for all of it.
fn painted_tint(share: f32) -> vec3f {
  let toward = mix(vec3f(0.46, 0.17, 0.05), vec3f(0.03, 0.30, 0.44), step(0.5, share));
  return mix(vec3f(0.30), toward, sqrt(clamp(abs(share - 0.5) * 2.0 - 0.01, 0.0, 1.0)));
}

fn level_tint(level: u32) -> vec3f {
  let hue = f32(level) * 0.61803;
  return 0.5 + 0.45 * cos(6.2831853 * (vec3f(hue) + vec3f(0.0, 0.33, 0.67)));
}

// Cursor rings lie on the ground: drawn where the ground is at the ring's distance. Display-encoded colours.
fn with_cursors(colour: vec3f, p: vec3f) -> vec3f {
  var c = colour;
  for (var i = 0u; i < view.cursor_count; i += 1u) {
    let ring = view.cursors[2u * i];
    let tint = view.cursors[2u * i + 1u];
    let away = distance(p.xy, ring.xy);
    if (away < ring.z * 1.6) {
      let line = clamp(1.5 - abs(away - ring.z) / ring.w, 0.0, 1.0);
      let centre = clamp(2.2 - away / ring.w, 0.0, 1.0);
      let halo = clamp(2.8 - abs(away - ring.z) / ring.w, 0.0, 1.0) * 0.30;
      c = mix(c, vec3f(0.0), halo * tint.a);
      c = mix(c, mix(c, tint.rgb, 0.14), f32(away < ring.z) * tint.a);
      c = mix(c, tint.rgb, max(line, centre) * tint.a);
    }
  }
  return c;
}
