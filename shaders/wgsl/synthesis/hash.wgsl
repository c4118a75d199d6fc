// Noise of detail synthesis: an integer hash of seed, level, stream and global sample index, the same bits everywhere
// (docs/synthesis.md, "Noise"; backend/esker/synthesis/hash.py).
fn synth_mix(word: u32) -> u32 {
  var x = word;
  x ^= x >> 16u;
  x *= u32(SYNTH_HASH_MULTIPLIER_1);
  x ^= x >> 15u;
  x *= u32(SYNTH_HASH_MULTIPLIER_2);
  x ^= x >> 16u;
  return x;
}

// The four children of a cell: columns i.x, i.y of row j.x, then of row j.y. `key` = synth_mix(seed + ...) of the stream.
fn synth_words(key: u32, i: vec2u, j: vec2u) -> vec4u {
  let south = synth_mix(key + j.x);
  let north = synth_mix(key + j.y);
  return vec4u(synth_mix(south + i.x), synth_mix(south + i.y), synth_mix(north + i.x), synth_mix(north + i.y));
}

// Uniform in [-1, 1), from 24 bits.
fn noise_full(words: vec4u) -> vec4f {
  return vec4f(words >> vec4u(8u)) * 0x1p-23 - 1.0;
}

// Uniform and symmetric in (-1, 1), from the low or the high half.
fn noise_low(words: vec4u) -> vec4f {
  return vec4f(words & vec4u(0xffffu)) * 0x1p-15 - (1.0 - 0x1p-16);
}

fn noise_high(words: vec4u) -> vec4f {
  return vec4f(words >> vec4u(16u)) * 0x1p-15 - (1.0 - 0x1p-16);
}
