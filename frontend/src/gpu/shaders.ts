/** The shader modules: ordered concatenation of readable files (DESIGN 9). */

import contract from "@shaders/generated/contract.wgsl?raw";
import patch from "@shaders/wgsl/ground/patch.wgsl?raw";
import terrain from "@shaders/wgsl/ground/terrain.wgsl?raw";
import wall from "@shaders/wgsl/ground/wall.wgsl?raw";
import hiddenBase from "@shaders/wgsl/hidden/base.wgsl?raw";
import hiddenDepth from "@shaders/wgsl/hidden/depth.wgsl?raw";
import hiddenSamples from "@shaders/wgsl/hidden/depth_samples.wgsl?raw";
import hidden from "@shaders/wgsl/hidden/hidden.wgsl?raw";
import instances from "@shaders/wgsl/instances/instances.wgsl?raw";
import scatter from "@shaders/wgsl/instances/scatter.wgsl?raw";
import stands from "@shaders/wgsl/instances/stands.wgsl?raw";
import ghost from "@shaders/wgsl/marks/ghost.wgsl?raw";
import label from "@shaders/wgsl/marks/label.wgsl?raw";
import placing from "@shaders/wgsl/marks/placing.wgsl?raw";
import ribbon from "@shaders/wgsl/marks/ribbon.wgsl?raw";
import detailPlain from "@shaders/wgsl/material/detail_plain.wgsl?raw";
import detailRich from "@shaders/wgsl/material/detail_rich.wgsl?raw";
import growth from "@shaders/wgsl/material/growth.wgsl?raw";
import lookAlpine from "@shaders/wgsl/material/look_alpine.wgsl?raw";
import lookDesert from "@shaders/wgsl/material/look_desert.wgsl?raw";
import lookNatural from "@shaders/wgsl/material/look_natural.wgsl?raw";
import lookPaper from "@shaders/wgsl/material/look_paper.wgsl?raw";
import noise from "@shaders/wgsl/material/noise.wgsl?raw";
import rock from "@shaders/wgsl/material/rock.wgsl?raw";
import shade from "@shaders/wgsl/material/shade.wgsl?raw";
import site from "@shaders/wgsl/material/site.wgsl?raw";
import snow from "@shaders/wgsl/material/snow.wgsl?raw";
import stonesPlain from "@shaders/wgsl/material/stones_plain.wgsl?raw";
import stonesRich from "@shaders/wgsl/material/stones_rich.wgsl?raw";
import wet from "@shaders/wgsl/material/wet.wgsl?raw";
import difference from "@shaders/wgsl/overlay/difference.wgsl?raw";
import overlayLines from "@shaders/wgsl/overlay/lines.wgsl?raw";
import overlay from "@shaders/wgsl/overlay/overlay.wgsl?raw";
import atmosphere from "@shaders/wgsl/sky/atmosphere.wgsl?raw";
import background from "@shaders/wgsl/sky/background.wgsl?raw";
import sky from "@shaders/wgsl/sky/sky.wgsl?raw";
import computeSky from "@shaders/wgsl/sky/tables.wgsl?raw";
import synthGullies from "@shaders/wgsl/synthesis/gullies.wgsl?raw";
import synthHash from "@shaders/wgsl/synthesis/hash.wgsl?raw";
import synthInterpolate from "@shaders/wgsl/synthesis/interpolate.wgsl?raw";
import ruleLandscape from "@shaders/wgsl/synthesis/rule_landscape.wgsl?raw";
import rulePlain from "@shaders/wgsl/synthesis/rule_plain.wgsl?raw";
import ruleSmooth from "@shaders/wgsl/synthesis/rule_smooth.wgsl?raw";
import synthSite from "@shaders/wgsl/synthesis/site.wgsl?raw";
import synthSlots from "@shaders/wgsl/synthesis/slots.wgsl?raw";
import computeSynthesis from "@shaders/wgsl/synthesis/synthesise.wgsl?raw";
import synthTargets from "@shaders/wgsl/synthesis/targets.wgsl?raw";
import computeBounds from "@shaders/wgsl/tiles/bounds.wgsl?raw";
import computeLight from "@shaders/wgsl/tiles/light.wgsl?raw";
import computeNormals from "@shaders/wgsl/tiles/normals.wgsl?raw";
import pages from "@shaders/wgsl/tiles/pages.wgsl?raw";
import computeSun from "@shaders/wgsl/tiles/sun.wgsl?raw";
import tile from "@shaders/wgsl/tiles/tile.wgsl?raw";
import tonemap from "@shaders/wgsl/tonemap.wgsl?raw";
import view from "@shaders/wgsl/view.wgsl?raw";
import drops from "@shaders/wgsl/water/drops.wgsl?raw";
import lakes from "@shaders/wgsl/water/lakes.wgsl?raw";
import rivers from "@shaders/wgsl/water/rivers.wgsl?raw";
import water from "@shaders/wgsl/water/water.wgsl?raw";
import type { Look } from "../generated/contract.ts";
import type { SynthesisRule } from "./synthesis/site.ts";

const join = (...parts: string[]): string => parts.join("\n");

const common = join(contract, view, tile, sky, noise, tonemap);

export const VIEW_SOURCE = view;

/** How much detail a device can afford: `plain` on adapters that draw on the CPU. */
export type Detail = "rich" | "plain";

const LOOKS: Readonly<Record<Look, string>> = {
  natural: lookNatural,
  alpine: lookAlpine,
  desert: lookDesert,
  paper: lookPaper,
};

const DETAILS: Readonly<Record<Detail, string>> = { rich: detailRich, plain: detailPlain };
const STONES: Readonly<Record<Detail, string>> = { rich: stonesRich, plain: stonesPlain };

/** The ground in one look. */
export function terrainSource(look: Look, detail: Detail): string {
  return join(
    common,
    DETAILS[detail],
    patch,
    lakes,
    site,
    rock,
    growth,
    snow,
    wet,
    STONES[detail],
    LOOKS[look],
    shade,
    rivers,
    overlayLines,
    overlay,
    difference,
    terrain,
  );
}

/** Walls, sea and background. */
export function sceneSource(part: "wall" | "background", detail: Detail): string {
  return part === "wall"
    ? join(common, DETAILS[detail], patch, wall)
    : join(common, DETAILS[detail], patch, overlayLines, overlay, lakes, water, background);
}

export const SOURCES = {
  ribbon: join(contract, view, ribbon),
  drops: join(contract, view, drops),
  ghost: join(contract, view, overlayLines, ghost),
  placing: join(contract, view, overlayLines, placing),
  label: join(contract, view, label),
  normals: join(contract, tile, computeNormals),
  sun: join(contract, tile, pages, computeSun),
  scatter: join(common, detailPlain, patch, lakes, pages, stands, scatter),
  instances: join(common, detailPlain, overlayLines, overlay, instances),
  light: join(contract, tile, computeLight),
  sky: join(atmosphere, computeSky),
  bounds: join(contract, tile, computeBounds),
  hidden: join(contract, view, tile, patch, hidden),
  hiddenDepth: join(contract, view, tile, patch, hidden, hiddenBase, hiddenDepth),
  hiddenSamples: join(contract, view, tile, patch, hidden, hiddenBase, hiddenSamples),
} as const;

const RULES: Readonly<Record<SynthesisRule, string>> = {
  landscape: ruleLandscape,
  smooth: ruleSmooth,
  plain: rulePlain,
};

/** Returns the source of the shader that makes the detail of the ground by one of the rules. */
export function synthesisSource(rule: SynthesisRule): string {
  return join(
    contract,
    tile,
    synthHash,
    synthInterpolate,
    synthSite,
    synthTargets,
    synthGullies,
    RULES[rule],
    synthSlots,
    computeSynthesis,
  );
}
