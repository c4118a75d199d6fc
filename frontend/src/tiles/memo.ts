/** A map with a bound: of two generations the older goes when the younger is full; what is read moves to the younger. */
export class Memo<V> {
  #young = new Map<number, V>();
  #old = new Map<number, V>();
  readonly #most: number;

  /** Holds at least the `most` values last used and at most twice as many. */
  constructor(most: number) {
    this.#most = most;
  }

  get size(): number {
    return this.#young.size + this.#old.size;
  }

  get(key: number): V | undefined {
    const found = this.#young.get(key);
    if (found !== undefined) return found;
    const older = this.#old.get(key);
    if (older !== undefined) {
      this.#old.delete(key);
      this.put(key, older);
    }
    return older;
  }

  put(key: number, value: V): void {
    if (this.#young.size >= this.#most) {
      this.#old = this.#young;
      this.#young = new Map();
    }
    this.#young.set(key, value);
  }
}
