// Interpolation of a parent's samples at its children (docs/synthesis.md, "Interpolation").
// One invocation makes the four children of a parent's cell p: columns 2p, 2p + 1 of rows 2q, 2q + 1, always in the order
// south-west, south-east, north-west, north-east. `r` holds p - 1 .. p + 2 of a row of parents; results along x are pairs
// (even, odd child). Means are taken as a sample plus a part of differences, which keeps the rounding of high ground small;
// products are with powers of two: contracted to fused operations or not, they round alike, so that different entry
// points make the same bits.

fn bspline_x(r: vec4f) -> vec2f {
  return vec2f(r.y + ((r.x - r.y) + (r.z - r.y)) * 0.125, (r.y + r.z) * 0.5);
}

fn bspline_y(a: vec2f, b: vec2f, c: vec2f) -> vec4f {
  return vec4f(b + ((a - b) + (c - b)) * 0.125, (b + c) * 0.5);
}

// Derivatives: times the parents' spacing.
fn derivative_x(r: vec4f) -> vec2f {
  return vec2f((r.z - r.x) * 0.5, r.z - r.y);
}

fn derivative_y(a: vec2f, b: vec2f, c: vec2f) -> vec4f {
  return vec4f((c - a) * 0.5, c - b);
}

// Second derivatives: times the square of the spacing.
fn second_x(r: vec4f) -> vec2f {
  return vec2f((r.x - r.y) + (r.z - r.y), ((r.x - r.y) + (r.w - r.z)) * 0.5);
}

fn second_y(a: vec2f, b: vec2f, c: vec2f, d: vec2f) -> vec4f {
  return vec4f((a - b) + (c - b), ((a - b) + (d - c)) * 0.5);
}

// (-1, 9, 9, -1) / 16: it keeps the parents' samples (Deslauriers and Dubuc).
fn four_point_x(r: vec4f) -> vec2f {
  return vec2f(r.y, (r.y + r.z) * 0.5 + ((r.y - r.x) + (r.z - r.w)) * 0.0625);
}

fn four_point_y(a: vec2f, b: vec2f, c: vec2f, d: vec2f) -> vec4f {
  return vec4f(b, (b + c) * 0.5 + ((b - a) + (c - d)) * 0.0625);
}

// Two channels in a word each, unorm16: (even, odd child) of the low half, then of the high one.
fn bspline_words_x(a: u32, b: u32, c: u32) -> vec4f {
  let west = unpack2x16unorm(a);
  let mid = unpack2x16unorm(b);
  let east = unpack2x16unorm(c);
  let even = mid + ((west - mid) + (east - mid)) * 0.125;
  let odd = (mid + east) * 0.5;
  return vec4f(even.x, odd.x, even.y, odd.y);
}

struct ChannelPair {
  low: vec4f,
  high: vec4f,
};

fn bspline_words_y(a: vec4f, b: vec4f, c: vec4f) -> ChannelPair {
  let even = b + ((a - b) + (c - b)) * 0.125;
  let odd = (b + c) * 0.5;
  return ChannelPair(vec4f(even.xy, odd.xy), vec4f(even.zw, odd.zw));
}
