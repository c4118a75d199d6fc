// Addresses in the atlas: a layer holds 16 x 16 slots, a slot one tile of 65 x 65 samples with a border of 2 (DESIGN 9).
const SLOT_BORDER: i32 = 2;
const SLOT_TEXELS: i32 = TILE_SAMPLES + 2 * SLOT_BORDER;
const SLOTS_ACROSS: u32 = 16u;
const SLOT_UV: f32 = 1.0 / f32(SLOT_TEXELS * i32(SLOTS_ACROSS));  // from a sample to the next, in texture coordinates

fn slot_layer(slot: u32) -> i32 {
  return i32(slot / (SLOTS_ACROSS * SLOTS_ACROSS));
}

// Texel of sample (0, 0) of a slot.
fn slot_origin(slot: u32) -> vec2i {
  return vec2i(vec2u(slot % SLOTS_ACROSS, (slot / SLOTS_ACROSS) % SLOTS_ACROSS)) * SLOT_TEXELS + SLOT_BORDER;
}

// Texture coordinates of a fractional sample position of a slot.
fn slot_uv(slot: u32, at: vec2f) -> vec2f {
  return (vec2f(slot_origin(slot)) + at + 0.5) / f32(SLOT_TEXELS * i32(SLOTS_ACROSS));
}
