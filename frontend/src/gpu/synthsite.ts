/** The settings of the synthesis as its shaders read them: `SynthSite` in shaders/wgsl/synth_site.wgsl. */

import {
  type Look,
  SYNTH_ALPHA,
  SYNTH_CHANNEL_NOISE,
  SYNTH_CHANNEL_NOISE_DECAY,
  SYNTH_HASH_MULTIPLIER_1,
  SYNTH_HASH_MULTIPLIER_2,
  SYNTH_HASH_STEP,
  SYNTH_HASH_STREAMS,
  SYNTH_LOOKS,
  SYNTH_SMOOTHNESS_NOISE,
  SYNTH_SMOOTHNESS_NOISE_DECAY,
  SYNTH_TIE,
  SYNTH_TIE_DECAY,
  SYNTH_TIE_MIN,
  TILE_CELLS,
} from "../generated/contract.ts";

export type SynthesisRule = "landscape" | "smooth" | "plain";

/** What all detail of a terrain depends on, besides ground and channels. */
export interface SynthesisSettings {
  readonly sizeM: number;
  readonly seed: number;
  /** Strength of the detail, 0..4. */
  readonly detail: number;
  readonly rule: SynthesisRule;
  readonly look: Look;
  readonly seaLevelM: number | null;
  /** Finest level that is solved everywhere: to it the guide is what was sent, above it the guide is interpolated. */
  readonly solved: number;
  /** The domain's east edge is its west edge, north its south. */
  readonly cyclic?: boolean;
}

const LEVELS = 18;
const HEAD_WORDS = 12;
const LEVEL_WORDS = 8;
export const SITE_BYTES: number = 4 * (HEAD_WORDS + LEVELS * LEVEL_WORDS);

/** The words of `SynthSite`. `channelBits`: the channels' grid has 2^channelBits cells a side; `biased`: with paint. */
export function siteWords(s: SynthesisSettings, channelBits: number, biased: boolean): Uint32Array<ArrayBuffer> {
  const words = new Uint32Array(SITE_BYTES / 4);
  const floats = new Float32Array(words.buffer);
  const look = SYNTH_LOOKS[s.look];
  const amplitude = (s.detail * SYNTH_ALPHA * s.sizeM) / TILE_CELLS;
  floats.set([s.sizeM, amplitude, s.seaLevelM ?? 0, s.seaLevelM === null ? 0 : 1]);
  floats.set([look.snowLine, look.treeLine, look.plants], 4);
  words.set([s.solved, s.cyclic === true ? 1 : 0, channelBits, biased ? 1 : 0], 7);
  for (let level = 0; level < LEVELS; level += 1) {
    const at = HEAD_WORDS + LEVEL_WORDS * level;
    for (let stream = 0; stream < 4; stream += 1) {
      words[at + stream] = mix(s.seed + SYNTH_HASH_STEP * (SYNTH_HASH_STREAMS * level + stream));
    }
    const spacing = s.sizeM / (TILE_CELLS * 2 ** Math.max(0, level - 1));
    const decay = (noise: number, rate: number): number => noise * 2 ** (-rate * level);
    const tie = Math.max(SYNTH_TIE_MIN, decay(SYNTH_TIE, SYNTH_TIE_DECAY));
    const channel = decay(SYNTH_CHANNEL_NOISE, SYNTH_CHANNEL_NOISE_DECAY);
    floats.set([1 / spacing, tie, channel, decay(SYNTH_SMOOTHNESS_NOISE, SYNTH_SMOOTHNESS_NOISE_DECAY)], at + 4);
  }
  return words;
}

/** Settings that make the same detail. */
export function sameSettings(a: SynthesisSettings, b: SynthesisSettings): boolean {
  return (
    a.sizeM === b.sizeM &&
    a.seed === b.seed &&
    a.detail === b.detail &&
    a.rule === b.rule &&
    a.look === b.look &&
    a.seaLevelM === b.seaLevelM &&
    a.solved === b.solved &&
    (a.cyclic === true) === (b.cyclic === true)
  );
}

/** `synth_mix` of synth_hash.wgsl; of a number below 2^53, its low 32 bits. */
function mix(word: number): number {
  let x = word % 2 ** 32;
  x = Math.imul(x ^ (x >>> 16), SYNTH_HASH_MULTIPLIER_1);
  x = Math.imul(x ^ (x >>> 15), SYNTH_HASH_MULTIPLIER_2);
  return (x ^ (x >>> 16)) >>> 0;
}
