/** A binary heap of numbers with an index each: the smallest comes first. */
export class Heap {
  size = 0;
  readonly #keys: Float32Array;
  readonly #items: Int32Array;

  constructor(capacity: number) {
    this.#keys = new Float32Array(capacity);
    this.#items = new Int32Array(capacity);
  }

  push(key: number, item: number): void {
    const keys = this.#keys;
    const items = this.#items;
    let at = this.size;
    this.size += 1;
    while (at > 0) {
      const up = (at - 1) >> 1;
      if (keys[up]! <= key) break;
      keys[at] = keys[up]!;
      items[at] = items[up]!;
      at = up;
    }
    keys[at] = key;
    items[at] = item;
  }

  /** The item of the smallest key, which goes; there must be one. */
  pop(): number {
    const keys = this.#keys;
    const items = this.#items;
    const found = items[0]!;
    this.size -= 1;
    const { size } = this;
    const key = keys[size]!;
    let at = 0;
    for (;;) {
      let down = 2 * at + 1;
      if (down >= size) break;
      if (down + 1 < size && keys[down + 1]! < keys[down]!) down += 1;
      if (keys[down]! >= key) break;
      keys[at] = keys[down]!;
      items[at] = items[down]!;
      at = down;
    }
    keys[at] = key;
    items[at] = items[size]!;
    return found;
  }
}
