/**
 * Streams of tiles that make up the ground. Twin of `ratio` and `finest_level` in `backend/esker/tiles/codec/frame.py`.
 */

import { CHANNEL_LEVELS_BELOW, Channel, MAX_LEVEL, MAX_REFINED_LEVEL } from "../generated/contract.ts";

/** True for the channels in quanta of heights, offsets and base, whose sum is what is drawn. */
export function isGround(channel: number): boolean {
  return channel === Channel.HEIGHT || channel === Channel.BASE;
}

/** Quanta of a level in one of the next coarser level: the ground halves its step, the other channels keep it. */
export function quantaRatio(channel: number): 1 | 2 {
  return isGround(channel) ? 2 : 1;
}

/** The finest level that a frame of this channel may have. */
export function finestLevel(channel: number): number {
  return isGround(channel) ? MAX_REFINED_LEVEL : MAX_LEVEL - CHANNEL_LEVELS_BELOW;
}
