/** A layer and a report of a file, for the tests of real ground. */

import type { ImportReport, Layer } from "../../src/generated/contract.ts";

export function layer(id: string, over: Partial<Layer> = {}): Layer {
  return {
    id,
    content: "0".repeat(64),
    facts: {
      rows: 101,
      cols: 201,
      low_m: 0,
      high_m: 500,
      valid: 1,
      geo: false,
      crs: "",
      format: "",
      file: `${id}.tif`,
      edge: [],
    },
    author: "",
    name: "",
    anchor: [100, 200],
    rotation_deg: 0,
    spacing_m: [10, 10],
    scale: 1,
    lift_m: 0,
    accuracy_m: 1,
    priority: 0,
    hidden: false,
    outline: 0.35,
    source: "",
    licence: "",
    ...over,
  };
}

export const REPORT: ImportReport = {
  verdict: "ask",
  file: "dome.npy",
  format: "NPY",
  rows: 96,
  cols: 96,
  dtype: "float32",
  crs: "",
  spacing_m: null,
  rotation_deg: 0,
  width_m: null,
  height_m: null,
  at: null,
  low_m: 2000,
  high_m: 2200,
  valid: 1,
  nodata: null,
  accuracy_m: null,
  notes: [],
  questions: [{ id: "size", text: "How wide?", options: [], default: "fit" }],
  refusal: "",
  preview: [
    [0, 255],
    [128, -1],
  ],
};
