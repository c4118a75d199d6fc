// Slots of tiles by level, column and row, found by hash (gpu/atlas/pagetable.ts). Modules bind the table as `pages`.
const NO_SLOT: u32 = 0xffffffffu;
const PLACES: u32 = 4096u;
const INDEX_MASK: u32 = (1u << u32(MAX_SYNTHESIS_LEVEL)) - 1u;

fn page(level: u32, tile: vec2u) -> u32 {
  let column = tile.x | (level << u32(MAX_SYNTHESIS_LEVEL));
  var place = ((column * 0x9e3779b1u) ^ (tile.y * 0x85ebca77u)) >> 20u;
  var entry = pages[place];
  while (entry.x != NO_SLOT && (entry.x != column || (entry.y & INDEX_MASK) != tile.y)) {
    place = (place + 1u) % PLACES;
    entry = pages[place];
  }
  return select(entry.y >> u32(MAX_SYNTHESIS_LEVEL), NO_SLOT, entry.x == NO_SLOT);
}
