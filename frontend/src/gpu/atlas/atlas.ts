/**
 * The tile atlas: ground, detail and light of up to 1,024 tiles in slots of 69 x 69 samples, least recently used out first
 * (DESIGN 9, 10). In textures 16 x 16 slots make a layer; in buffers slot follows slot.
 *
 * A tile is held by the store, or *synthetic*: made from its parent alone, on any level above the solved ones. Its samples
 * are a function of the held tiles around it and of its parent's slot, so what changes makes anew all that lies below it, in
 * the same frame: tiles that the store applied together switch together and neighbours never disagree. Only tiles that are
 * new to the atlas are rationed.
 */

import { keyLevel, keyX, keyY, tileKey } from "../../core/tilekey.ts";
import type { Tile, TileView } from "../../core/types.ts";
import type { Slots, TileRequest } from "../../tiles/patches/selection.ts";
import { assembleSlot, SELF_BIT, SLOT_AREA, SLOT_TEXELS } from "./apron.ts";
import { BaseFades } from "./basefades.ts";
import { NO_SLOT, PageTable } from "./pagetable.ts";

export const SLOTS_ACROSS = 16;
export const SLOTS_PER_LAYER = SLOTS_ACROSS * SLOTS_ACROSS;
export const MAX_SLOTS = 1024;
/** Devices that compute on the CPU have less to spare. */
export const SOFTWARE_SLOTS = 512;

export interface Resident {
  readonly level: number;
  readonly x: number;
  readonly y: number;
  readonly slot: number;
  /** Sources of the slot's samples: the newest stamp of the nine tiles, and the mask of those that were held. */
  stamp: number;
  held: number;
  /** Its held heights, as they were last sent. */
  shown?: Float32Array | undefined;
  /** Rises each time that the slot is filled. */
  version: number;
  /** Frame in which the cut last rested on it. */
  used: number;
}

/** Called when a tile enters or leaves. */
export type ResidencyListener = (level: number, x: number, y: number, usable: boolean) => void;

/** Tiles whose slots must be filled anew, parents before children. */
export interface Changes {
  /** All of it. */
  readonly remade: readonly Resident[];
  /** Their ground moved, their detail did not: above the solved levels it does not depend on what is held. */
  readonly moved: readonly Resident[];
}

const NOTHING: Changes = { remade: [], moved: [] };

export class Atlas implements Slots {
  /** vec2f a sample: guide and base, metres. */
  readonly grounds: GPUBuffer;
  /** vec4u a sample: detail and channels. */
  readonly state: GPUBuffer;
  /** Displayed heights. */
  readonly heights: GPUTexture;
  readonly attributes0: GPUTexture;
  readonly attributes1: GPUTexture;
  readonly slopes: GPUTexture;
  readonly light: GPUTexture;
  /** Slot of each resident tile (pagetable.ts). */
  readonly pages: GPUBuffer;
  readonly capacity: number;
  /** The last `admit` found no slot that it could have emptied. */
  full = false;
  readonly #pageTable = new PageTable();
  readonly #byTile = new Map<number, Resident>();
  readonly #bySlot: (Resident | undefined)[];
  readonly #free: number[] = [];
  #view: TileView | null = null;
  /** The last refresh found tiles changed that were there before; finer tiles that only came do not count. */
  groundMoved = false;
  readonly #fades = new BaseFades();
  readonly #staging = new Float32Array(2 * SLOT_AREA);
  /** Stamps of the store's tiles at the last refresh. */
  #stamps = new Map<number, number>();
  #viewStamp = -1;
  #allStale = false;
  #frame = 0;
  #pagesDirty = true;

  readonly #device: GPUDevice;
  readonly #onResidency: ResidencyListener;

  constructor(device: GPUDevice, onResidency: ResidencyListener, capacity = MAX_SLOTS) {
    this.#device = device;
    this.#onResidency = onResidency;
    const stateBytes = SLOT_AREA * 16;
    this.capacity = Math.min(capacity, Math.floor(device.limits.maxStorageBufferBindingSize / stateBytes));
    const layers = Math.ceil(this.capacity / SLOTS_PER_LAYER);
    const side = SLOTS_ACROSS * SLOT_TEXELS;
    const make = (label: string, format: GPUTextureFormat, more = 0): GPUTexture =>
      device.createTexture({
        label,
        format,
        size: [side, side, Math.max(2, layers)],
        usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.COPY_SRC | more,
      });
    this.heights = make("atlas heights", "r32float");
    this.attributes0 = make("atlas attributes 0", "rgba8unorm");
    this.attributes1 = make("atlas attributes 1", "rgba8unorm");
    this.slopes = make("atlas slopes", "rgba16float");
    this.light = make("atlas light", "rgba8unorm", GPUTextureUsage.COPY_DST);
    const buffer = (label: string, size: number): GPUBuffer =>
      device.createBuffer({
        label,
        size,
        usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST | GPUBufferUsage.COPY_SRC,
      });
    this.grounds = buffer("atlas grounds", this.capacity * SLOT_AREA * 8);
    this.state = buffer("atlas state", this.capacity * stateBytes);
    this.pages = buffer("atlas pages", this.#pageTable.words.byteLength);
    this.#bySlot = new Array<Resident | undefined>(this.capacity).fill(undefined);
    // Slot 0 is the root's for good: the water outside the domain reads it (water/water.wgsl).
    for (let slot = this.capacity - 1; slot > 0; slot -= 1) this.#free.push(slot);
  }

  slot(level: number, x: number, y: number): number {
    return this.#byTile.get(tileKey(level, x, y))?.slot ?? NO_SLOT;
  }

  touch(level: number, x: number, y: number): void {
    const resident = this.#byTile.get(tileKey(level, x, y));
    if (resident !== undefined) resident.used = this.#frame;
  }

  /** True when the last cut rests on the tile. */
  isCurrent(resident: Resident): boolean {
    return resident.used === this.#frame;
  }

  /** False once the tile has been evicted. */
  holds(resident: Resident): boolean {
    return this.#bySlot[resident.slot] === resident;
  }

  /** The tile one level coarser; the root is its own. */
  parentOf(resident: Resident): Resident {
    return this.#parent(resident.level, resident.x, resident.y) ?? resident;
  }

  /** Resident tiles, in no order. */
  residents(): Iterable<Resident> {
    return this.#byTile.values();
  }

  /** Slots in use. */
  get count(): number {
    return this.#byTile.size;
  }

  /**
   * Says that seed, strength or rule of the detail, or what strokes ask of it, has changed: all slots are filled again.
   */
  remakeAll(): void {
    this.#allStale = true;
  }

  /** True while ground blends over from what was interpolated to what came, or back. */
  get blending(): boolean {
    return this.#fades.any;
  }

  /**
   * Starts a frame: uploads what is held of every resident tile that changed, and drops tiles that the store no longer has
   * and nobody can make. `lean`: what changed and the last cut did not rest on leaves, instead of being made anew unseen.
   * `share`: by how much of its way ground blends on that comes or goes; 1: it is there at once.
   */
  refresh(view: TileView, lean = false, share = 1): Changes {
    this.#frame += 1;
    this.groundMoved = false;
    this.full = false;
    if (view.stamp === this.#viewStamp && !this.#allStale && !this.blending) return NOTHING;
    const stored = view.stamp !== this.#viewStamp;
    this.#viewStamp = view.stamp;
    this.#view = view;
    if (stored) {
      this.#noteMoves(view);
      if (share < 1) this.#startFades(view);
    }
    const blended = this.#fades.advance(share, (key) => view.tile(keyLevel(key), keyX(key), keyY(key))?.heights);
    const remade: Resident[] = [];
    const moved: Resident[] = [];
    const whole = new Set<Resident>();
    const based = new Set<Resident>();
    for (const resident of [...this.residents()].sort((a, b) => a.level - b.level)) {
      const up = this.parentOf(resident);
      if (!this.holds(resident)) continue;
      if (!this.#canFill(resident.level, resident.x, resident.y)) {
        this.#evict(resident);
        continue;
      }
      const { stamp, held } = this.#signature(resident.level, resident.x, resident.y);
      const changed = stamp !== resident.stamp || held !== resident.held || this.#touchesAny(resident, blended);
      const anew = this.#allStale || whole.has(up) || (changed && resident.level <= view.solved);
      if (!anew && !changed && !based.has(up)) continue;
      if (lean && resident.level > 0 && resident.used < this.#frame - 1) {
        this.#evict(resident);
        continue;
      }
      resident.stamp = stamp;
      resident.held = held;
      resident.version += 1;
      if (changed) this.#upload(resident);
      (anew ? whole : based).add(resident);
      (anew ? remade : moved).push(resident);
    }
    this.#allStale = false;
    return { remade, moved };
  }

  /** Brings in requested tiles, at most `limit`, whose parents are there; returns those that entered. */
  admit(requests: readonly TileRequest[], limit: number): Resident[] {
    const entered: Resident[] = [];
    for (const { level, x, y } of requests) {
      if (entered.length >= limit) break;
      if (!this.#canFill(level, x, y) || this.slot(level, x, y) !== NO_SLOT) continue;
      const up = level > 0 ? this.#parent(level, x, y) : undefined;
      if (level > 0 && up === undefined) continue;
      const slot = level === 0 ? 0 : this.#takeSlot();
      if (slot === undefined) {
        this.full = true;
        break;
      }
      const resident: Resident = { level, x, y, slot, ...this.#signature(level, x, y), version: 0, used: this.#frame };
      this.#bySlot[slot] = resident;
      this.#byTile.set(tileKey(level, x, y), resident);
      this.#pagesDirty = true;
      this.#upload(resident);
      this.#touchAbove(resident);
      this.#onResidency(level, x, y, true);
      entered.push(resident);
    }
    return entered;
  }

  /** Sends the page table when it changed. */
  flushPages(): void {
    if (!this.#pagesDirty) return;
    this.#pagesDirty = false;
    this.#pageTable.fill(this.residents());
    this.#device.queue.writeBuffer(this.pages, 0, this.#pageTable.words);
  }

  destroy(): void {
    for (const texture of [this.heights, this.attributes0, this.attributes1, this.slopes, this.light])
      texture.destroy();
    for (const buffer of [this.pages, this.grounds, this.state]) buffer.destroy();
  }

  /** Refined tiles that came to a resident synthetic one, or left a resident held one, blend over. Parents first. */
  #startFades(view: TileView): void {
    for (const { level, x, y, held, shown } of [...this.residents()].sort((a, b) => a.level - b.level)) {
      if (level <= view.solved) continue;
      const parent = this.#heightsAt(level - 1, x >> 1, y >> 1);
      const isHeld = view.tile(level, x, y) !== undefined;
      const wasHeld = (held & SELF_BIT) !== 0;
      if (parent === undefined) continue;
      if (isHeld && (!wasHeld || (this.#fades.heights(level, x, y) && !this.#fades.arrives(level, x, y))))
        this.#fades.arrive(level, x, y, parent);
      else if (
        !isHeld &&
        wasHeld &&
        shown !== undefined &&
        (this.#fades.arrives(level, x, y) || !this.#fading(level, x, y))
      )
        this.#fades.leave(level, x, y, shown, parent);
    }
  }

  #fading(level: number, x: number, y: number): boolean {
    return this.#fades.heights(level, x, y) !== undefined;
  }

  #touchesAny({ level, x, y }: Resident, keys: ReadonlySet<number>): boolean {
    if (keys.size === 0) return false;
    for (let i = 0; i < 9; i += 1)
      if (keys.has(tileKey(level, x + (i % 3) - 1, y + Math.floor(i / 3) - 1))) return true;
    return false;
  }

  /** Returns a tile's ground where the tile is held or blends, else undefined. */
  #heightsAt(level: number, x: number, y: number): Float32Array | undefined {
    const side = 2 ** level;
    if (x < 0 || y < 0 || x >= side || y >= side) return undefined;
    return this.#fades.heights(level, x, y) ?? this.#view?.tile(level, x, y)?.heights;
  }

  #noteMoves(view: TileView): void {
    const stamps = new Map<number, number>();
    for (const { level, x, y, stamp } of view.tiles()) {
      const key = tileKey(level, x, y);
      if ((this.#stamps.get(key) ?? stamp) !== stamp) this.groundMoved = true;
      stamps.set(key, stamp);
    }
    this.#stamps = stamps;
  }

  /** A tile that is held, or above the solved levels any below one that is in the atlas. */
  #canFill(level: number, x: number, y: number): boolean {
    if (this.#at(level, x, y) !== undefined) return true;
    return this.#view !== null && level > this.#view.solved && this.#parent(level, x, y) !== undefined;
  }

  #parent(level: number, x: number, y: number): Resident | undefined {
    return level === 0 ? undefined : this.#byTile.get(tileKey(level - 1, x >> 1, y >> 1));
  }

  /** A tile's parents leave after it. */
  #touchAbove(resident: Resident): void {
    for (let up = this.#parent(resident.level, resident.x, resident.y); up !== undefined; )
      if (up.used === this.#frame) return;
      else {
        up.used = this.#frame;
        up = this.#parent(up.level, up.x, up.y);
      }
  }

  #at(level: number, x: number, y: number): Tile | undefined {
    const side = 2 ** level;
    if (x < 0 || y < 0 || x >= side || y >= side) return undefined;
    return this.#view?.tile(level, x, y);
  }

  #signature(level: number, x: number, y: number): { stamp: number; held: number } {
    let stamp = -1;
    let held = 0;
    for (let dy = -1; dy <= 1; dy += 1) {
      for (let dx = -1; dx <= 1; dx += 1) {
        if (this.#heightsAt(level, x + dx, y + dy) === undefined) continue;
        held |= 1 << (3 * (dy + 1) + dx + 1);
        const tile = this.#at(level, x + dx, y + dy);
        if (tile !== undefined && tile.stamp > stamp) stamp = tile.stamp;
      }
    }
    return { stamp, held };
  }

  /** Sends what is held of a slot. The device tells by the mask which samples those are. */
  #upload(resident: Resident): void {
    const { level, x, y, slot, held } = resident;
    resident.shown = this.#heightsAt(level, x, y);
    if (held === 0) return;
    assembleSlot((dx, dy) => this.#heightsAt(level, x + dx, y + dy), this.#staging);
    this.#device.queue.writeBuffer(this.grounds, slot * SLOT_AREA * 8, this.#staging as Float32Array<ArrayBuffer>);
  }

  #takeSlot(): number | undefined {
    const slot = this.#free.pop();
    if (slot !== undefined) return slot;
    let oldest: Resident | undefined;
    for (const resident of this.residents()) {
      // Tiles that the last cut rests on stay; the root never leaves.
      if (resident.used >= this.#frame - 1 || resident.level === 0) continue;
      const later = oldest === undefined ? -1 : resident.used - oldest.used || oldest.level - resident.level;
      if (later < 0) oldest = resident;
    }
    if (oldest === undefined) return undefined;
    this.#evict(oldest);
    return this.#free.pop();
  }

  /** A tile leaves with all that was made from it. */
  #evict(resident: Resident): void {
    const { level, x, y } = resident;
    this.#bySlot[resident.slot] = undefined;
    if (resident.slot !== 0) this.#free.push(resident.slot);
    this.#byTile.delete(tileKey(level, x, y));
    this.#fades.finish(level, x, y);
    this.#pagesDirty = true;
    this.#onResidency(level, x, y, false);
    for (let q = 0; q < 4; q += 1) {
      const below = this.#byTile.get(tileKey(level + 1, 2 * x + (q & 1), 2 * y + (q >> 1)));
      if (below !== undefined) this.#evict(below);
    }
  }
}
