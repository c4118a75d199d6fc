/** The shader modules: ordered concatenation of readable files (DESIGN 9). */

import contract from "@shaders/generated/contract.wgsl?raw";
import atmosphere from "@shaders/wgsl/atmosphere.wgsl?raw";
import background from "@shaders/wgsl/background.wgsl?raw";
import computeNormals from "@shaders/wgsl/compute_normals.wgsl?raw";
import computeSky from "@shaders/wgsl/compute_sky.wgsl?raw";
import computeSun from "@shaders/wgsl/compute_sun.wgsl?raw";
import ghost from "@shaders/wgsl/ghost.wgsl?raw";
import material from "@shaders/wgsl/material.wgsl?raw";
import noise from "@shaders/wgsl/noise.wgsl?raw";
import overlay from "@shaders/wgsl/overlay.wgsl?raw";
import patch from "@shaders/wgsl/patch.wgsl?raw";
import ribbon from "@shaders/wgsl/ribbon.wgsl?raw";
import sky from "@shaders/wgsl/sky.wgsl?raw";
import terrain from "@shaders/wgsl/terrain.wgsl?raw";
import tile from "@shaders/wgsl/tile.wgsl?raw";
import tonemap from "@shaders/wgsl/tonemap.wgsl?raw";
import view from "@shaders/wgsl/view.wgsl?raw";
import wall from "@shaders/wgsl/wall.wgsl?raw";
import water from "@shaders/wgsl/water.wgsl?raw";

const join = (...parts: string[]): string => parts.join("\n");

const common = join(contract, view, tile, sky, noise, tonemap);

export const VIEW_SOURCE = view;
export const SUN_LIST_SOURCE = computeSun;

export const SOURCES = {
  terrain: join(common, patch, material, overlay, terrain),
  wall: join(common, patch, wall),
  background: join(common, patch, overlay, water, background),
  ribbon: join(common, ribbon),
  ghost: join(common, overlay, ghost),
  normals: join(contract, tile, computeNormals),
  sun: join(contract, tile, computeSun),
  sky: join(atmosphere, computeSky),
} as const;
