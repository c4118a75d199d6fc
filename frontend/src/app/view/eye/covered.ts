/**
 * Margins of the picture that the page's bars and the inspector cover, so that home shows the whole land beside them.
 * Pure.
 */

import type { Insets } from "../../../core/camera/home.ts";

/** A box in the window, CSS pixels. */
export type Box = Pick<DOMRect, "left" | "top" | "right" | "bottom">;

/** Boxes of the parts that float on the picture; null where one is not shown. */
export interface Chrome {
  readonly top: Box | null;
  readonly tools: Box | null;
  readonly foot: Box | null;
  readonly side: Box | null;
}

/** CSS pixels that stay free beside each part. */
const GAP_PX = 6;
/** A panel that begins farther right than this share of the picture stands beside it; else it is a drawer below. */
const BESIDE = 0.3;

/** How much of each edge of the picture is covered, CSS pixels. */
export function coveredEdges(picture: Box, { top, tools, foot, side }: Chrome): Insets {
  const below = (box: Box | null): number =>
    box !== null && box.bottom > box.top && box.top < picture.bottom ? picture.bottom - box.top + GAP_PX : 0;
  const upright = tools !== null && tools.bottom - tools.top > tools.right - tools.left;
  const beside = side !== null && side.left > picture.left + BESIDE * (picture.right - picture.left);
  return {
    left: upright ? Math.max(0, tools.right - picture.left + GAP_PX) : GAP_PX,
    top: top === null ? GAP_PX : Math.max(0, top.bottom - picture.top) + GAP_PX,
    right: beside ? Math.max(0, picture.right - side.left) + GAP_PX : GAP_PX,
    bottom: Math.max(GAP_PX, below(foot), upright ? 0 : below(tools)),
  };
}
