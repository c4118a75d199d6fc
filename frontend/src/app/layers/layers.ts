/** Elevation layers as the page orders, names and colours them. Pure. */

import { msg, str } from "@lit/localize";
import { fixed, grouped, significant } from "../../core/language.ts";
import { extentOf } from "../../core/lattice.ts";
import type { ImportReport, Layer, SimpleOp } from "../../generated/contract.ts";
import { metres } from "../words/words.ts";

/** Colours of footprints: apart from strokes and from each other, on snow as on rock. */
const COLOURS = ["#f2b134", "#4cc3a5", "#c58cf0", "#f07f6e", "#6fb4ff", "#b7d34a"] as const;

export function layerColour(id: string): string {
  let hash = 0;
  for (const c of id) hash = (hash * 31 + c.codePointAt(0)!) >>> 0;
  return COLOURS[hash % COLOURS.length]!;
}

/** The layers, what is believed first at the top: greater priority, then greater id (docs/patchwork.md). */
export function orderedLayers(layers: Iterable<Layer>): Layer[] {
  return [...layers].sort((a, b) => b.priority - a.priority || (a.id < b.id ? 1 : -1));
}

/** The changes of priority that bring a layer to place `to` of the ordered list: as few as will do. */
export function reorderOps(ordered: readonly Layer[], id: string, to: number): SimpleOp[] {
  const from = ordered.findIndex((l) => l.id === id);
  if (from < 0 || from === to || to < 0 || to >= ordered.length) return [];
  const next = ordered.filter((l) => l.id !== id);
  next.splice(to, 0, ordered[from]!);
  const priorities = new Map<string, number>();
  const above = next[to - 1];
  const below = next[to + 1];
  const least = (below?.priority ?? Number.NEGATIVE_INFINITY) + 1;
  const most = (above?.priority ?? Number.POSITIVE_INFINITY) - 1;
  if (Number.isFinite(least)) priorities.set(id, least);
  else if (Number.isFinite(most)) priorities.set(id, most);
  // Whatever stands above must stay strictly above.
  for (let i = to - 1; i >= 0; i--) {
    const under = priorities.get(next[i + 1]!.id) ?? next[i + 1]!.priority;
    if (next[i]!.priority > under) break;
    priorities.set(next[i]!.id, under + 1);
  }
  return next.flatMap((l) => {
    const priority = priorities.get(l.id);
    return priority === undefined || priority === l.priority
      ? []
      : [{ type: "layer.set" as const, layer: l.id, fields: { priority } }];
  });
}

/** The name that people see. */
export function layerName(layer: Layer): string {
  return layer.name || layer.facts.file || msg("Elevation grid");
}

/** A height in whole metres with a real minus. */
export const wholeMetres = (m: number): string => `${m < 0 ? "−" : ""}${Math.abs(Math.round(m))} m`;

const count = (n: number): string => grouped(n);

/** Spacing in words; anisotropic ones with both numbers. */
export function spacingWords([sx, sy]: readonly [number, number]): string {
  const one = (v: number): string => significant(v, 3);
  return Math.abs(sx - sy) < 0.01 * sx ? `${one(sx)} m` : `${one(sx)} × ${one(sy)} m`;
}

type Row = readonly [what: string, how: string];

/** Returns the facts of a layer, as rows of a table. */
export function layerFacts(layer: Layer): Row[] {
  const { facts } = layer;
  const [wide, tall] = extentOf(facts, layer);
  const heights = [facts.low_m, facts.high_m].map((h) => layer.scale * h + layer.lift_m).sort((a, b) => a - b);
  return [
    [msg("Samples"), `${count(facts.cols)} × ${count(facts.rows)}`],
    [msg("Spacing"), spacingWords(layer.spacing_m)],
    [msg("On the ground"), `${metres(wide)} × ${metres(tall)}`],
    [msg("Heights"), msg(str`${wholeMetres(heights[0]!)} to ${wholeMetres(heights[1]!)}`)],
    ...(facts.valid < 0.9995 ? [[msg("With data"), percent(facts.valid)] as const] : []),
    ...(facts.file ? [[msg("File"), facts.file] as const] : []),
    ...(facts.crs ? [[msg("Map projection"), facts.crs] as const] : []),
  ];
}

/** Returns the facts of a file that are known, as rows of a table. */
export function reportFacts(report: ImportReport): Row[] {
  const rows: Row[] = [];
  const put = (what: string, how: string | null): void => {
    if (how) rows.push([what, how]);
  };
  put(msg("Format"), [report.format, report.dtype].filter(Boolean).join(", "));
  put(msg("Samples"), report.cols > 0 ? `${count(report.cols)} × ${count(report.rows)}` : null);
  put(msg("Spacing"), report.spacing_m && spacingWords(report.spacing_m));
  put(
    msg("On the ground"),
    report.width_m === null || report.height_m === null
      ? null
      : `${metres(report.width_m)} × ${metres(report.height_m)}`,
  );
  put(msg("Turned"), Math.abs(report.rotation_deg) > 0.05 ? `${fixed(report.rotation_deg, 1)}°` : null);
  put(msg("Map projection"), report.crs);
  put(msg("Middle"), report.at && placeWords(report.at));
  put(
    msg("Heights"),
    report.low_m === null || report.high_m === null
      ? null
      : msg(str`${wholeMetres(report.low_m)} to ${wholeMetres(report.high_m)}`),
  );
  put(msg("With data"), report.valid !== null && report.valid < 0.9995 ? percent(report.valid) : null);
  return rows;
}

/** "46.19° N, 122.19° W". */
export function placeWords([lat, lon]: readonly [number, number]): string {
  const part = (v: number, plus: string, minus: string): string => `${fixed(Math.abs(v), 2)}° ${v < 0 ? minus : plus}`;
  return `${part(lat, msg("N"), msg("S"))}, ${part(lon, msg("E"), msg("W"))}`;
}

/** A share as per cent that never claims all or nothing falsely. */
export function percent(share: number): string {
  if (share > 0.99 && share < 1) return msg("over 99 %");
  if (share > 0 && share < 0.01) return msg("under 1 %");
  return `${Math.round(100 * share)} %`;
}
