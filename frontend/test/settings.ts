import type { TerrainSettings } from "../src/generated/contract.ts";

/** Settings of a terrain of 4096 m with everything as a new one has it, for all tests. */
export const SETTINGS: TerrainSettings = {
  size_m: 4096,
  edition: 1,
  title: "T",
  reach_m: 128,
  border: "free",
  sea_level_m: null,
  lakes_m: null,
  rivers: 0,
  wetness: 1,
  seed: 1,
  look: "natural",
  detail: 1,
  rule: "landscape",
  erosion: 0,
  erosion_scale: 10,
  hold: 1,
  sun_azimuth_deg: 115,
  sun_elevation_deg: 24,
  place: null,
  task: null,
  task_pictures: [],
};
