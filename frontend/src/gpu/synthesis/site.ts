/** The settings of the synthesis as its shaders read them: `SynthSite` in shaders/wgsl/synthesis/site.wgsl. */

import type { Look, Place, Rule } from "../../generated/contract.ts";
import {
  MAX_SYNTHESIS_LEVEL,
  SYNTH_CHANNEL_NOISE,
  SYNTH_CHANNEL_NOISE_DECAY,
  SYNTH_FAR_SHARE,
  SYNTH_GULLY_CYCLIC_SIDE,
  SYNTH_GULLY_STREAM,
  SYNTH_SMOOTHNESS_NOISE,
  SYNTH_SMOOTHNESS_NOISE_DECAY,
  TILE_CELLS,
} from "../../generated/contract.ts";
import { streamStart } from "../../tiles/detail/noise.ts";
import { depthM, waveM } from "../../tiles/rules/gullies.ts";
import { type ErosionSettings, type GroundSpan, siteOf } from "../../tiles/rules/rule.ts";
import { tie } from "../../tiles/rules/targets.ts";
import type { ChannelFacts } from "./channels.ts";

export type SynthesisRule = Rule;

/** Settings that all detail of a terrain depends on, besides ground and channels. */
export interface SynthesisSettings {
  readonly sizeM: number;
  readonly seed: number;
  /** Strength of the detail, 0..4. */
  readonly detail: number;
  readonly erosion?: ErosionSettings;
  readonly rule: SynthesisRule;
  readonly look: Look;
  readonly seaLevelM: number | null;
  /** Where on Earth the terrain lies, if anywhere. */
  readonly place?: Place | null;
  /** Lowest and highest sample of its elevation layers, metres. */
  readonly ground?: GroundSpan | null;
  /** Finest level that is solved everywhere: to it the guide is what was sent, above it the guide is interpolated. */
  readonly solved: number;
  /** The domain's east edge is its west edge, north its south. */
  readonly cyclic?: boolean;
}

const LEVELS = MAX_SYNTHESIS_LEVEL + 1;
const HEAD_WORDS = 24;
const LEVEL_WORDS = 12;
export const SITE_BYTES: number = 4 * (HEAD_WORDS + LEVELS * LEVEL_WORDS);

/** The words of `SynthSite`. */
export function siteWords(s: SynthesisSettings, channels: ChannelFacts): Uint32Array<ArrayBuffer> {
  const words = new Uint32Array(SITE_BYTES / 4);
  const floats = new Float32Array(words.buffer);
  const { sizeM, seaLevelM } = s;
  const site = siteOf({
    size_m: sizeM,
    seed: s.seed,
    sea_level_m: seaLevelM,
    look: s.look,
    detail: s.detail,
    rule: s.rule,
    place: s.place ?? null,
    ground: s.ground ?? null,
    ...(s.erosion === undefined ? {} : erosionOf(s.erosion)),
  });
  floats.set([sizeM, site.amplitudeM, site.zeroM, seaLevelM === null ? 0 : 1]);
  floats.set([site.snowLine, site.treeLine, site.plants], 4);
  const { bits, varied, biased, surveyed, gullied, stride, farCells } = channels;
  words.set([s.solved, s.cyclic === true ? 1 : 0, bits, varied ? 1 : 0, biased ? 1 : 0, surveyed ? 1 : 0], 7);
  floats.set([site.reliefM, site.shoreM], 13);
  const cyclic = s.cyclic === true;
  const lattice = { sizeM, gullySide: cyclic ? SYNTH_GULLY_CYCLIC_SIDE : site.gullySide };
  words.set([stride, gullied || site.erosion > 0 ? 1 : 0, lattice.gullySide], 15);
  floats.set([site.erosion, site.hold, SYNTH_FAR_SHARE * sizeM, sizeM / (2 * Math.max(TILE_CELLS, farCells))], 18);
  for (let level = 0; level < LEVELS; level += 1) {
    const at = HEAD_WORDS + LEVEL_WORDS * level;
    for (let stream = 0; stream < 4; stream += 1) words[at + stream] = streamStart(s.seed, level, stream);
    const spacing = sizeM / (TILE_CELLS * 2 ** Math.max(0, level - 1));
    const channel = SYNTH_CHANNEL_NOISE * 2 ** (-SYNTH_CHANNEL_NOISE_DECAY * level);
    const smoothness = SYNTH_SMOOTHNESS_NOISE * 2 ** (-SYNTH_SMOOTHNESS_NOISE_DECAY * level);
    floats.set([1 / spacing, tie(level), channel, smoothness], at + 4);
    words[at + 8] = streamStart(s.seed, level, SYNTH_GULLY_STREAM);
    floats.set([waveM(lattice, level), depthM(lattice, level)], at + 9);
  }
  return words;
}

/** The settings of the gullies alone: a terrain's settings hold more. */
function erosionOf({ erosion, erosion_scale, hold }: ErosionSettings): ErosionSettings {
  return { erosion, erosion_scale, hold };
}

/** Settings that make the same detail. */
export function sameSettings(a: SynthesisSettings, b: SynthesisSettings): boolean {
  return (
    a.sizeM === b.sizeM &&
    a.seed === b.seed &&
    a.detail === b.detail &&
    a.erosion?.erosion === b.erosion?.erosion &&
    a.erosion?.erosion_scale === b.erosion?.erosion_scale &&
    a.erosion?.hold === b.erosion?.hold &&
    a.rule === b.rule &&
    a.look === b.look &&
    a.seaLevelM === b.seaLevelM &&
    a.place?.lat_deg === b.place?.lat_deg &&
    a.ground?.[0] === b.ground?.[0] &&
    a.ground?.[1] === b.ground?.[1] &&
    a.solved === b.solved &&
    (a.cyclic === true) === (b.cyclic === true)
  );
}
