/**
 * The tile atlas: heights, gradients and light of up to 1,024 tiles in slots of 69 x 69 texels, 16 x 16 slots a layer,
 * least recently used out first (DESIGN 9).
 *
 * All resident tiles that changed are uploaded in one frame, so tiles that the store applied together switch together and
 * neighbours never disagree; only tiles that are new to the atlas are rationed.
 */

import { tileKey } from "../core/tilekey.ts";
import type { Tile, TileView } from "../core/types.ts";
import type { Slots, TileRequest } from "../tiles/selection.ts";
import { assembleSlot, SLOT_TEXELS } from "./apron.ts";
import { NO_SLOT, PageTable } from "./pagetable.ts";

export const SLOTS_ACROSS = 16;
export const SLOTS_PER_LAYER = SLOTS_ACROSS * SLOTS_ACROSS;
export const MAX_SLOTS = 1024;
/** New tiles that may enter in one frame. */
export const NEW_TILES_PER_FRAME = 16;

export interface Resident {
  readonly level: number;
  readonly x: number;
  readonly y: number;
  readonly slot: number;
  /** What the slot was filled from: the newest stamp and the number of the nine tiles that were held. */
  stamp: number;
  neighbours: number;
  /** Frame in which the cut last rested on it. */
  used: number;
}

/** Called when a tile enters or leaves. */
export type ResidencyListener = (level: number, x: number, y: number, usable: boolean) => void;

export class Atlas implements Slots {
  readonly heights: GPUTexture;
  readonly slopes: GPUTexture;
  readonly light: GPUTexture;
  /** Slot of each resident tile (pagetable.ts). */
  readonly pages: GPUBuffer;
  readonly capacity: number;
  private readonly pageTable = new PageTable();
  private readonly byTile = new Map<number, Resident>();
  private readonly bySlot: (Resident | undefined)[];
  private readonly free: number[] = [];
  private view: TileView | null = null;
  /** The last refresh found tiles changed that were there before; finer tiles that only came do not count. */
  groundMoved = false;
  private readonly staging = new Float32Array(SLOT_TEXELS * SLOT_TEXELS);
  /** Stamps of the store's tiles at the last refresh. */
  private stamps = new Map<number, number>();
  private viewStamp = -1;
  private frame = 0;
  private pagesDirty = true;

  constructor(
    private readonly device: GPUDevice,
    readonly levels: number,
    private readonly onResidency: ResidencyListener,
    capacity = MAX_SLOTS,
  ) {
    const layers = Math.ceil(Math.min(capacity, tilesUpTo(levels)) / SLOTS_PER_LAYER);
    this.capacity = Math.min(capacity, layers * SLOTS_PER_LAYER);
    const side = SLOTS_ACROSS * SLOT_TEXELS;
    const make = (label: string, format: GPUTextureFormat, usage: GPUTextureUsageFlags): GPUTexture =>
      device.createTexture({
        label,
        format,
        size: [side, side, Math.max(2, layers)],
        usage: usage | GPUTextureUsage.TEXTURE_BINDING,
      });
    this.heights = make("atlas heights", "r32float", GPUTextureUsage.COPY_DST | GPUTextureUsage.COPY_SRC);
    this.slopes = make("atlas slopes", "rgba16float", GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.COPY_SRC);
    this.light = make("atlas light", "rgba8unorm", GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.COPY_SRC);
    this.pages = device.createBuffer({
      label: "atlas pages",
      size: this.pageTable.words.byteLength,
      usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST,
    });
    this.bySlot = new Array<Resident | undefined>(this.capacity).fill(undefined);
    // Slot 0 is the root's for good: the water outside the domain reads it (water.wgsl).
    for (let slot = this.capacity - 1; slot > 0; slot -= 1) this.free.push(slot);
  }

  slot(level: number, x: number, y: number): number {
    return this.byTile.get(tileKey(level, x, y))?.slot ?? NO_SLOT;
  }

  touch(level: number, x: number, y: number): void {
    const resident = this.byTile.get(tileKey(level, x, y));
    if (resident !== undefined) resident.used = this.frame;
  }

  /** True when the last cut rests on the tile. */
  isCurrent(resident: Resident): boolean {
    return resident.used === this.frame;
  }

  /** False once the tile has been evicted. */
  holds(resident: Resident): boolean {
    return this.bySlot[resident.slot] === resident;
  }

  /** Resident tiles, in no order. */
  residents(): Iterable<Resident> {
    return this.byTile.values();
  }

  get count(): number {
    return this.capacity - this.free.length;
  }

  /**
   * Starts a frame: uploads every resident tile whose samples or border changed, drops those that the store no longer
   * has. Returns the slots whose gradients must be computed anew.
   */
  refresh(view: TileView): Resident[] {
    this.frame += 1;
    this.groundMoved = false;
    if (view.stamp === this.viewStamp) return [];
    this.viewStamp = view.stamp;
    this.view = view;
    this.noteMoves(view);
    const changed: Resident[] = [];
    for (const resident of [...this.residents()]) {
      if (this.at(resident.level, resident.x, resident.y) === undefined) {
        this.evict(resident);
        continue;
      }
      const { stamp, neighbours } = this.signature(resident.level, resident.x, resident.y);
      if (stamp === resident.stamp && neighbours === resident.neighbours) continue;
      resident.stamp = stamp;
      resident.neighbours = neighbours;
      this.upload(resident);
      changed.push(resident);
    }
    return changed;
  }

  /** Brings in requested tiles, at most `limit`; returns those that entered. */
  admit(requests: readonly TileRequest[], limit: number): Resident[] {
    const entered: Resident[] = [];
    for (const { level, x, y } of requests) {
      if (entered.length >= limit) break;
      if (this.at(level, x, y) === undefined || this.slot(level, x, y) !== NO_SLOT) continue;
      const slot = level === 0 ? 0 : this.takeSlot();
      if (slot === undefined) break;
      const resident: Resident = { level, x, y, slot, ...this.signature(level, x, y), used: this.frame };
      this.bySlot[slot] = resident;
      this.byTile.set(tileKey(level, x, y), resident);
      this.pagesDirty = true;
      this.upload(resident);
      this.onResidency(level, x, y, true);
      entered.push(resident);
    }
    return entered;
  }

  /** Sends the page table when it changed. */
  flushPages(): void {
    if (!this.pagesDirty) return;
    this.pagesDirty = false;
    this.pageTable.fill(this.residents());
    this.device.queue.writeBuffer(this.pages, 0, this.pageTable.words);
  }

  destroy(): void {
    for (const texture of [this.heights, this.slopes, this.light]) texture.destroy();
    this.pages.destroy();
  }

  private noteMoves(view: TileView): void {
    const stamps = new Map<number, number>();
    for (const { level, x, y, stamp } of view.tiles()) {
      const key = tileKey(level, x, y);
      if ((this.stamps.get(key) ?? stamp) !== stamp) this.groundMoved = true;
      stamps.set(key, stamp);
    }
    this.stamps = stamps;
  }

  private at(level: number, x: number, y: number): Tile | undefined {
    const side = 1 << level;
    if (x < 0 || y < 0 || x >= side || y >= side) return undefined;
    return this.view?.tile(level, x, y);
  }

  private signature(level: number, x: number, y: number): { stamp: number; neighbours: number } {
    let stamp = -1;
    let neighbours = 0;
    for (let dy = -1; dy <= 1; dy += 1) {
      for (let dx = -1; dx <= 1; dx += 1) {
        const tile = this.at(level, x + dx, y + dy);
        if (tile === undefined) continue;
        neighbours |= 1 << ((dy + 1) * 3 + dx + 1);
        if (tile.stamp > stamp) stamp = tile.stamp;
      }
    }
    return { stamp, neighbours };
  }

  private upload(resident: Resident): void {
    const { level, x, y, slot } = resident;
    assembleSlot(this.at(level, x, y)!, (dx, dy) => this.at(level, x + dx, y + dy), this.staging);
    const col = slot % SLOTS_ACROSS;
    const row = Math.floor(slot / SLOTS_ACROSS) % SLOTS_ACROSS;
    this.device.queue.writeTexture(
      { texture: this.heights, origin: [col * SLOT_TEXELS, row * SLOT_TEXELS, Math.floor(slot / SLOTS_PER_LAYER)] },
      this.staging as Float32Array<ArrayBuffer>,
      { bytesPerRow: SLOT_TEXELS * 4, rowsPerImage: SLOT_TEXELS },
      [SLOT_TEXELS, SLOT_TEXELS, 1],
    );
  }

  private takeSlot(): number | undefined {
    const slot = this.free.pop();
    if (slot !== undefined) return slot;
    let oldest: Resident | undefined;
    for (const resident of this.residents()) {
      // What the last cut rests on is pinned; the root never leaves.
      if (resident.used >= this.frame - 1 || resident.level === 0) continue;
      if (oldest === undefined || resident.used < oldest.used) oldest = resident;
    }
    if (oldest === undefined) return undefined;
    this.evict(oldest);
    return this.free.pop();
  }

  private evict(resident: Resident): void {
    this.bySlot[resident.slot] = undefined;
    if (resident.slot !== 0) this.free.push(resident.slot);
    this.byTile.delete(tileKey(resident.level, resident.x, resident.y));
    this.pagesDirty = true;
    this.onResidency(resident.level, resident.x, resident.y, false);
  }
}

/** How many tiles levels 0 to `level` can have. */
function tilesUpTo(level: number): number {
  return (4 ** (level + 1) - 1) / 3;
}
