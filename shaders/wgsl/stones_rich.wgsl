// What the ground is made of a few steps away: broken rock, stones, tufts. stones_plain.wgsl has the same functions for
// adapters that draw on the CPU.
//
// The stones texture (gpu/passes/stones.ts), binding 12: r = how far in from its stone's edge, g = a number of the stone's own,
// ba = gradient of the stone's leaning, rounded relief. STONES_PERIOD stones side by side, then it repeats.
const STONES_PERIOD: f32 = 24.0;

struct Stones {
  inside: f32,   // 0 in the gap, 1 in the middle of a stone
  own: f32,      // each stone's, 0..1
  slope: vec2f,  // of its leaning, rounded back
  seen: f32,     // 1 where a stone covers some pixels, 0 where none can be told from another
};

fn stone_sample(at: vec2f, dx: vec2f, dy: vec2f, scale: f32) -> vec4f {
  let k = 1.0 / scale;
  return textureSampleGrad(stones, smooth_repeat, at * k, dx * k, dy * k);
}

// Stones of `size` metres on the plane that the ground faces, or on the two that it faces most; `push`: metres by which
// noise bends their edges, which makes them unlike each other.
fn stones_at(s: Site, size: f32, turn: vec2f, push: vec2f) -> Stones {
  let seen = 1.0 - smoothstep(0.16, 0.55, s.footprint / size);
  if (seen <= 0.0) { return Stones(0.5, 0.5, vec2f(0.0), 0.0); }
  let scale = size * STONES_PERIOD;
  let p = s.bent + vec3f(push, push.x - push.y);
  var w = s.n * s.n;
  w = w * w * w;
  w /= w.x + w.y + w.z;
  var t = stone_sample(turned(p.xy, turn), turned(s.f.dx.xy, turn), turned(s.f.dy.xy, turn), scale);
  let g = t.ba - 0.5;
  t = vec4f(t.rg, vec2f(g.x * turn.x + g.y * turn.y, g.y * turn.x - g.x * turn.y) + 0.5);
  if (w.z < 0.96) {
    let east = stone_sample(p.yz, s.f.dx.yz, s.f.dy.yz, scale);
    let north = stone_sample(p.xz, s.f.dx.xz, s.f.dy.xz, scale);
    t = t * w.z + vec4f(east.rg, 0.5, east.b) * w.x + vec4f(north.rg, north.b, 0.5) * w.y;
  }
  return Stones(t.r, t.g, (t.ba - 0.5) * NOISE_GRADIENT, seen);
}

fn push_medium(s: Site) -> vec2f { return (s.fine2.rg - 0.5) * 2.4; }

fn push_small(s: Site) -> vec2f { return (s.fine3.rg - 0.5) * 0.42; }

// 1 in the gap between stones, `wide` of the way in.
fn gap(t: Stones, wide: f32) -> f32 {
  return t.seen * (1.0 - smoothstep(0.02, wide, t.inside));
}

// Rock in blocks: each face leans its own way. Joints open here and there, chips are broken off along them.
fn broken(m: Material, s: Site, amount: f32) -> Material {
  let big = stones_at(s, 2.9, vec2f(0.921, 0.389), push_medium(s));
  let small = stones_at(s, 0.47, vec2f(0.515, -0.857), push_small(s));
  let chips = stones_at(s, 0.085, vec2f(0.743, 0.669), push_small(s) * 0.2);
  // On a face a slope must be larger to turn the light as far.
  let face = amount * (1.0 + 0.8 * s.steep * s.steep);
  let open = smoothstep(0.42, 0.66, s.fine1.g * 0.6 + s.fine2.g * 0.4);
  let rough = smoothstep(0.35, 0.65, s.fine2.g + (big.own - 0.5) * 0.4);
  let dark = gap(big, 0.14) * 0.42 * open + gap(small, 0.20) * 0.36 * rough + gap(chips, 0.30) * 0.26 * (1.0 - 0.6 * rough);
  let tone = 1.0 + big.seen * (big.own - 0.5) * 0.16 + small.seen * (small.own - 0.5) * 0.20 + chips.seen * (chips.own - 0.5) * 0.24;
  let slope = big.slope * (0.30 * big.seen * (0.4 + 0.6 * open)) + small.slope * (0.24 * small.seen * (0.3 + 0.7 * rough))
    + chips.slope * (0.13 * chips.seen);
  return Material(m.albedo * tone * (1.0 - dark * amount), m.slope + slope * face, m.gloss, m.soft);
}

// Loose stones of three sizes, dark between.
fn heaped(m: Material, s: Site, amount: f32) -> Material {
  let big = stones_at(s, 0.66, vec2f(0.788, 0.616), push_small(s));
  let small = stones_at(s, 0.16, vec2f(0.342, -0.940), push_small(s) * 0.35);
  let grit = stones_at(s, 0.038, vec2f(0.955, 0.296), vec2f(0.0));
  // Big ones lie in drifts; between them, and elsewhere, small ones.
  let lies = smoothstep(0.40, 0.60, big.own * 0.45 + s.fine2.r * 0.55) * big.seen;
  let top = smoothstep(0.16, 0.34, big.inside) * lies;
  let under = (gap(small, 0.42) * 0.42 + gap(grit, 0.5) * 0.26) * (1.0 - top * 0.85);
  let rim = (1.0 - smoothstep(0.02, 0.26, big.inside)) * lies * 0.50;
  let tone = 1.0 + top * (big.own - 0.62) * 1.1 + (1.0 - top) * small.seen * (small.own - 0.5) * 0.62 + grit.seen * (grit.own - 0.5) * 0.34;
  let hue = mix(vec3f(1.0), mix(vec3f(1.12, 0.99, 0.86), vec3f(0.92, 1.0, 1.09), fract(big.own * 7.0)), top);
  let slope = big.slope * (0.55 * lies) + small.slope * (0.40 * small.seen * (1.0 - top * 0.8)) + grit.slope * (0.20 * grit.seen);
  return Material(m.albedo * mix(vec3f(1.0), hue * tone, amount) * (1.0 - (under + rim) * amount), m.slope + slope * amount, m.gloss, m.soft);
}

// Grass: clumps, tufts, and blades that lie this way and that; stones that peek out, ringed by what grows at their foot.
fn tufted(m: Material, s: Site, stone: vec3f) -> Material {
  let near = 1.0 - smoothstep(0.10, 0.36, s.footprint);
  if (near <= 0.0) { return m; }
  let here = s.bent.xy;
  let one = blades(here, s, vec2f(0.669, 0.743));
  let other = blades(here, s, vec2f(0.174, -0.985));
  let lie = smoothstep(0.42, 0.58, s.fine3.r);
  let blade = mix(one, other, lie) - vec4f(0.5);
  let clump = s.fine3.r - 0.5;
  // Straw among the green, thicker in some clumps than in others.
  let straw = smoothstep(0.05, 0.30, blade.r * 0.9 + (s.fine3.g - 0.5) * 0.5 + (s.fine2.g - 0.5) * 0.6) * near;
  let colour = mix(m.albedo, m.albedo * vec3f(2.1, 1.55, 1.15), straw * 0.5) * (1.0 + near * (blade.g * 1.5 + clump * 0.9));
  let grass = Material(colour, m.slope + near * (noise_slope(s.fine3) * 0.16 + blade.ba * 1.6), m.gloss, m.soft);
  let big = stones_at(s, 0.42, vec2f(0.259, 0.966), push_small(s));
  let small = stones_at(s, 0.13, vec2f(0.743, 0.669), push_small(s) * 0.4);
  let dry = (s.fine2.g - 0.5) * 0.36 + clump * 0.3;
  let rough = (blade.r + clump) * 0.45;
  let boulder = big.seen * smoothstep(0.945, 0.960, big.own + dry * 0.25);
  let pebble = small.seen * smoothstep(0.915, 0.945, small.own + dry * 0.8);
  let bare = max(boulder * smoothstep(0.16, 0.24, big.inside + rough), pebble * smoothstep(0.20, 0.30, small.inside + rough * 0.7));
  let slope = mix(small.slope * 1.1, big.slope * 1.5, boulder);
  let grain = 0.45 + 0.45 * fract(big.own * 37.0 + small.own * 11.0) + clump * 0.5 + blade.r * 0.3;
  // Their shadow, and what grows thicker at their foot.
  let foot = max(boulder * smoothstep(0.0, 0.16, big.inside), pebble * smoothstep(0.02, 0.20, small.inside)) * (1.0 - bare);
  let grown = Material(grass.albedo * (1.0 - 0.55 * foot), grass.slope, grass.gloss, grass.soft);
  let moss = mix(vec3f(1.0), vec3f(0.72, 0.84, 0.46), smoothstep(0.45, 0.70, s.fine3.g) * 0.8);
  return mix_in(grown, Material(stone * moss * grain, m.slope * 0.3 + slope + blade.ba * 0.5, 0.0, 0.0), bare);
}

// Noise drawn out along one way, from a hand to a blade's width.
fn blades(at: vec2f, s: Site, way: vec2f) -> vec4f {
  let narrow = vec2f(0.21, 1.0);
  return noise_sample(turned(at, way) * narrow, turned(s.f.dx.xy, way) * narrow, turned(s.f.dy.xy, way) * narrow, 0.27);
}

// Crowns of trees, each its own: round, lit on top, dark between. From below they would be stains on the ground.
fn crowned(m: Material, s: Site) -> Material {
  let tree = stones_at(s, 6.5, vec2f(0.788, 0.616), push_medium(s) * 0.8);
  let seen = tree.seen * smoothstep(0.35, 0.90, s.footprint);
  let shade = seen * ((tree.inside - 0.42) * 1.1 + (tree.own - 0.5) * 0.7);
  return Material(m.albedo * (1.0 + shade), m.slope + tree.slope * (0.9 * seen), m.gloss, m.soft);
}
