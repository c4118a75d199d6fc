/**
 * Offsets of a WGSL struct, read from the shader's own text: one description of what host and shader share.
 * Knows the types that the project's uniform structs use.
 */

interface TypeInfo {
  readonly size: number;
  readonly align: number;
}

const TYPES: Readonly<Record<string, TypeInfo>> = {
  f32: { size: 4, align: 4 },
  u32: { size: 4, align: 4 },
  i32: { size: 4, align: 4 },
  vec2f: { size: 8, align: 8 },
  vec3f: { size: 12, align: 16 },
  vec4f: { size: 16, align: 16 },
  vec4u: { size: 16, align: 16 },
  mat4x4f: { size: 64, align: 16 },
};

export interface StructLayout {
  /** Bytes, a multiple of 16. */
  readonly size: number;
  /** Byte offset of each field. */
  readonly offsets: Readonly<Record<string, number>>;
  /** True for u32 fields. */
  readonly integers: ReadonlySet<string>;
}

function typeInfo(type: string): TypeInfo {
  const array = /^array<\s*(\w+)\s*,\s*(\d+)\s*>$/.exec(type);
  if (array !== null) {
    const element = typeInfo(array[1]!);
    return { size: Math.ceil(element.size / 16) * 16 * Number(array[2]), align: 16 };
  }
  const info = TYPES[type];
  if (info === undefined) throw new Error(`layout: unknown WGSL type ${type}`);
  return info;
}

/** Layout of `struct name` in a WGSL source; throws when it is absent or uses a type not listed above. */
export function structLayout(source: string, name: string): StructLayout {
  const body = new RegExp(`struct\\s+${name}\\s*\\{([^}]*)\\}`).exec(source)?.[1];
  if (body === undefined) throw new Error(`layout: no struct ${name}`);
  const offsets: Record<string, number> = {};
  const integers = new Set<string>();
  let at = 0;
  for (const match of body.replace(/\/\/[^\n]*/g, "").matchAll(/(\w+)\s*:\s*(array<[^>]*>|\w+)/g)) {
    const field = match[1]!;
    const type = match[2]!;
    const info = typeInfo(type);
    at = Math.ceil(at / info.align) * info.align;
    offsets[field] = at;
    if (type === "u32") integers.add(field);
    at += info.size;
  }
  return { size: Math.ceil(at / 16) * 16, offsets, integers };
}

/** Writes named fields of a struct into a buffer of its size. */
export class StructWriter {
  readonly buffer: ArrayBuffer;
  readonly #floats: Float32Array;
  readonly #words: Uint32Array;

  constructor(readonly layout: StructLayout) {
    this.buffer = new ArrayBuffer(layout.size);
    this.#floats = new Float32Array(this.buffer);
    this.#words = new Uint32Array(this.buffer);
  }

  /** Sets a field; `skip` counts 4-byte elements from its start. Throws for an unknown field. */
  set(field: string, value: number | ArrayLike<number>, skip = 0): void {
    const offset = this.layout.offsets[field];
    if (offset === undefined) throw new Error(`layout: no field ${field}`);
    const into = this.layout.integers.has(field) ? this.#words : this.#floats;
    if (typeof value === "number") into[offset / 4 + skip] = value;
    else into.set(value, offset / 4 + skip);
  }
}
