// What the ground is made of a few steps away: broken rock, stones, tufts. stones_plain.wgsl has the same functions for
// adapters that draw on the CPU.
//
// The stones texture (gpu/passes/stones.ts), binding 12: r = how far in from its stone's edge, g = a number of the stone's own,
// ba = gradient of the stone's leaning, rounded relief. STONES_PERIOD stones side by side, then it repeats.
const STONES_PERIOD: f32 = 24.0;

struct Stones {
  inside: f32,   // 0 in the gap, 1 in the middle of a stone
  own: f32,      // each stone's, 0..1
  lean: vec3f,   // gradient of its leaning, rounded back in the world's axes
  seen: f32,     // 1 where a stone covers some pixels, 0 where none can be told from another
};

fn stone_sample(at: vec2f, dx: vec2f, dy: vec2f, scale: f32) -> vec4f {
  let k = 1.0 / scale;
  return textureSampleGrad(stones, smooth_repeat, at * k, dx * k, dy * k);
}

// Stones of `size` metres on the plane that the ground faces most, so that none is a mixture of two; `push`: metres by which
// noise bends their edges, which makes them unlike each other. `flat`: how many times as long as high they are on faces.
fn stones_at(s: Site, size: f32, turn: vec2f, push: vec3f, flat: f32) -> Stones {
  let seen = 1.0 - smoothstep(0.16, 0.55, s.footprint / size);
  if (seen <= 0.0) { return Stones(0.5, 0.5, vec3f(0.0), 0.0); }
  let scale = size * STONES_PERIOD;
  let p = s.bent + push;
  // Where two planes meet, the noise decides: a straight seam would be seen.
  let a = abs(s.faces) + vec3f(0.0, 0.0, 0.10 * (s.wide.r - 0.5));
  if (a.z > 0.62) {
    let t = stone_sample(turned(p.xy, turn), turned(s.f.dx.xy, turn), turned(s.f.dy.xy, turn), scale);
    let g = (t.ba - 0.5) * NOISE_GRADIENT;
    return Stones(t.r, t.g, vec3f(g.x * turn.x + g.y * turn.y, g.y * turn.x - g.x * turn.y, 0.0), seen);
  }
  let up = vec2f(1.0, flat);
  if (a.x + 0.15 * (s.near.r - 0.5) > a.y) {
    let t = stone_sample(p.yz * up, s.f.dx.yz * up, s.f.dy.yz * up, scale);
    return Stones(t.r, t.g, vec3f(0.0, (t.ba - 0.5) * NOISE_GRADIENT), seen);
  }
  let t = stone_sample(p.xz * up, s.f.dx.xz * up, s.f.dy.xz * up, scale);
  let g = (t.ba - 0.5) * NOISE_GRADIENT;
  return Stones(t.r, t.g, vec3f(g.x, 0.0, g.y), seen);
}

// By how much noise bends the edges of stones of a size: by some of it where that is many pixels, by all layers.
fn ragged(s: Site, size: f32) -> vec3f {
  let a = vec3f(s.near.r - 0.5, s.near.g - 0.5, s.near.r - s.near.g) * min(0.30 * size, 16.0 * s.footprint);
  let b = vec3f(s.wide.g - 0.5, s.wide.r - 0.5, s.wide.g - s.wide.r) * min(0.34 * size, 60.0 * s.footprint);
  return a + b;
}

// 1 in the gap between stones, `wide` of the way in.
fn gap(t: Stones, wide: f32) -> f32 {
  return t.seen * (1.0 - smoothstep(0.02, wide, t.inside));
}

// Rock in blocks, five sizes of them: each face leans its own way. Joints open here and there, chips are broken off along
// them. Blocks lie in the beds: longer than high.
fn broken(m: Material, s: Site, amount: f32) -> Material {
  let huge = stones_at(s, 13.0, vec2f(0.788, 0.616), ragged(s, 13.0), 1.5);
  let big = stones_at(s, 2.9, vec2f(0.921, 0.389), ragged(s, 2.9), 1.7);
  let small = stones_at(s, 0.47, vec2f(0.515, -0.857), ragged(s, 0.47), 1.6);
  let chips = stones_at(s, 0.085, vec2f(0.743, 0.669), ragged(s, 0.085), 1.4);
  let grain = stones_at(s, 0.015, vec2f(0.342, 0.940), vec3f(0.0), 1.2);
  let open = smoothstep(0.42, 0.66, s.fine1.g * 0.6 + s.fine2.g * 0.4);
  let rough = smoothstep(0.35, 0.65, s.fine2.g + (big.own - 0.5) * 0.4);
  let shut = gap(huge, 0.09) * 0.60 + gap(big, 0.14) * 0.70 * (0.25 + 0.75 * open) + gap(small, 0.20) * 0.60 * (0.2 + 0.8 * rough)
    + gap(chips, 0.26) * 0.30 * (1.0 - 0.6 * rough) + gap(grain, 0.4) * 0.22;
  let tone = 1.0 + huge.seen * (huge.own - 0.5) * 0.16 + big.seen * (big.own - 0.5) * 0.20 + small.seen * (small.own - 0.5) * 0.20
    + chips.seen * (chips.own - 0.5) * 0.20 + grain.seen * (grain.own - 0.5) * 0.24;
  let lean = huge.lean * (0.55 * huge.seen) + big.lean * (0.62 * big.seen * (0.4 + 0.6 * open)) + small.lean * (0.50 * small.seen * (0.3 + 0.7 * rough))
    + chips.lean * (0.34 * chips.seen) + grain.lean * (0.22 * grain.seen);
  let dark = min(shut * amount, 0.85);
  return Material(m.albedo * tone * (1.0 - 0.6 * dark), m.relief * 0.8 + lean * amount, m.gloss, m.soft, m.open * (1.0 - dark),
    clamp(m.high + 0.3 * (big.own - 0.5) * big.seen + 0.25 * (small.own - 0.5) * small.seen - 0.3 * dark, 0.0, 1.0));
}

// Loose stones of four sizes, dark between. Big ones lie in drifts on small ones.
fn heaped(m: Material, s: Site, amount: f32) -> Material {
  let big = stones_at(s, 0.66, vec2f(0.788, 0.616), ragged(s, 0.66), 1.0);
  let small = stones_at(s, 0.17, vec2f(0.342, -0.940), ragged(s, 0.17), 1.0);
  let grit = stones_at(s, 0.042, vec2f(0.955, 0.296), vec3f(0.0), 1.0);
  let dust = stones_at(s, 0.011, vec2f(0.669, 0.743), vec3f(0.0), 1.0);
  let lies = smoothstep(0.44, 0.56, big.own * 0.45 + s.fine2.r * 0.35 + s.wide.r * 0.20) * big.seen;
  let top = smoothstep(0.12, 0.28, big.inside) * lies;
  let some = smoothstep(0.40, 0.52, small.own * 0.6 + s.wide.g * 0.4) * small.seen * (1.0 - top);
  let pebble = smoothstep(0.14, 0.34, small.inside) * some;
  let shut = (gap(grit, 0.5) * 0.30 + gap(dust, 0.5) * 0.20) * (1.0 - 0.7 * max(top, pebble))
    + (1.0 - smoothstep(0.0, 0.20, big.inside)) * lies * 0.62 + (1.0 - smoothstep(0.0, 0.26, small.inside)) * some * 0.50;
  let tone = 1.0 + top * (big.own - 0.60) * 0.9 + pebble * (fract(small.own * 17.0) - 0.42) * 0.8
    + (1.0 - max(top, pebble)) * (grit.seen * (grit.own - 0.5) * 0.55 - 0.10) + dust.seen * (dust.own - 0.5) * 0.22;
  let hue = mix(vec3f(1.0), mix(vec3f(1.12, 0.99, 0.86), vec3f(0.90, 1.0, 1.10), fract(big.own * 7.0 + small.own * 3.0)), max(top, pebble) * 0.8);
  let lean = big.lean * (0.62 * lies) + small.lean * (0.55 * some) + grit.lean * (0.26 * grit.seen * (1.0 - 0.7 * max(top, pebble)))
    + dust.lean * (0.12 * dust.seen);
  let dark = min(shut * amount, 0.8);
  return Material(m.albedo * mix(vec3f(1.0), hue * tone, amount) * (1.0 - 0.45 * dark), m.relief * 0.7 + lean * amount, m.gloss, m.soft,
    m.open * (1.0 - dark), clamp(m.high + 0.35 * top + 0.2 * pebble - 0.3 * dark, 0.0, 1.0));
}

// Grass: strands that lie over each other, each layer its own way, tips light, the ground between them in their shade; straw
// among the green.
fn tufted(m: Material, s: Site, dry: f32) -> Material {
  let near = 1.0 - smoothstep(0.008, 0.045, s.footprint);
  if (near <= 0.0) { return m; }
  // Tufts of a hand, which lean and part.
  let tuft = ground_noise(s.p, s.f, 1.3, vec2f(0.829, 0.559));
  let bend = vec3f((tuft.rg - 0.5) * 0.16, 0.0);
  let low = strands(s.p + bend, s, vec2f(0.669, 0.743), 0.17);
  let middle = strands(s.p - bend, s, vec2f(0.174, -0.985), 0.14);
  let top = strands(s.p + bend.yxz * 1.5, s, vec2f(0.934, 0.358), 0.12);
  let over = smoothstep(0.40, 0.62, middle.r + (tuft.r - 0.5) * 0.8);
  let tips = smoothstep(0.50, 0.74, top.r + (tuft.g - 0.5) * 0.7);
  var height = mix(0.25 + 0.35 * low.r, 0.45 + 0.40 * middle.r, over);
  height = mix(height, 0.70 + 0.5 * (top.r - 0.5), tips);
  let straw = smoothstep(0.56, 0.80, mix(middle.g, top.g, tips) * 0.7 + dry * 0.35 + (tuft.r - 0.5) * 0.7);
  let hue = mix(vec3f(1.0), vec3f(1.75, 1.42, 1.15), straw * 0.65);
  var out = m;
  out.albedo = m.albedo * mix(vec3f(1.0), hue * (0.50 + 0.85 * height) * (0.86 + 0.4 * (tuft.g - 0.3)), near);
  let lean = mix(mix(low.ba, middle.ba, over), top.ba, tips) - 0.5;
  out.relief = m.relief + vec3f(lean * (1.5 * near) + noise_slope(tuft) * (0.14 * near), 0.0);
  out.open = m.open * mix(1.0, clamp(0.25 + 1.0 * height, 0.2, 1.0), near);
  out.high = mix(m.high, clamp(height, 0.0, 1.0), near);
  return out;
}

// Noise drawn out along one way, from a finger's to a blade's width.
fn strands(p: vec3f, s: Site, way: vec2f, scale: f32) -> vec4f {
  let narrow = vec2f(0.07, 1.0);
  let n = noise_sample(turned(p.xy, way) * narrow, turned(s.f.dx.xy, way) * narrow, turned(s.f.dy.xy, way) * narrow, scale);
  // The gradient across a strand, back in the world's axes.
  let across = n.a - 0.5;
  return vec4f(n.rg, across * way.y + 0.5, across * way.x + 0.5);
}

// Crowns of trees, each its own: round, lit on top, dark between. From below they would be stains on the ground.
fn crowned(m: Material, s: Site) -> Material {
  let tree = stones_at(s, 6.5, vec2f(0.788, 0.616), ragged(s, 6.5), 1.0);
  let seen = tree.seen * smoothstep(0.25, 0.70, s.footprint);
  let tone = 1.0 + seen * ((tree.inside - 0.42) * 0.8 + (tree.own - 0.5) * 0.7);
  return Material(m.albedo * tone, m.relief + tree.lean * (0.9 * seen), m.gloss, m.soft, m.open * mix(1.0, 0.35 + 0.75 * tree.inside, seen), m.high);
}
