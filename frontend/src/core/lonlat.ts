/**
 * Longitude and latitude of places on a terrain that lies on Earth: the inverse of the transverse Mercator projection of WGS 84 around
 * the terrain's place, which is in the middle of its domain (`frame` in backend/esker/importing/placement/fitting.py). Krüger's series to the third
 * order: about a millimetre where terrains reach (Karney, "Transverse Mercator with an accuracy of a few nanometers", J. Geodesy 85, 2011).
 */

import { msg } from "@lit/localize";
import { fixed } from "./language.ts";

const A_M = 6_378_137;
const F = 1 / 298.257223563;
const N = F / (2 - F);
const RADIUS_M = (A_M / (1 + N)) * (1 + N ** 2 / 4 + N ** 4 / 64);
const ALPHA = [
  N / 2 - (2 * N ** 2) / 3 + (5 * N ** 3) / 16,
  (13 * N ** 2) / 48 - (3 * N ** 3) / 5,
  (61 * N ** 3) / 240,
];
const BETA = [N / 2 - (2 * N ** 2) / 3 + (37 * N ** 3) / 96, N ** 2 / 48 + N ** 3 / 15, (17 * N ** 3) / 480];
const DELTA = [2 * N - (2 * N ** 2) / 3 - 2 * N ** 3, (7 * N ** 2) / 3 - (8 * N ** 3) / 5, (56 * N ** 3) / 15];
const RAD = Math.PI / 180;

const sum = (terms: readonly number[], of: (j: number) => number): number =>
  terms.reduce((all, term, i) => all + term * of(2 * (i + 1)), 0);

/** The arc of the meridian from the equator, in parts of RADIUS_M. */
function arcOf(latRad: number): number {
  const k = (2 * Math.sqrt(N)) / (1 + N);
  const s = Math.sin(latRad);
  const xi = Math.atan(Math.sinh(Math.atanh(s) - k * Math.atanh(k * s)));
  return xi + sum(ALPHA, (j) => Math.sin(j * xi));
}

export interface LonLat {
  readonly lonDeg: number;
  readonly latDeg: number;
}

/** The place on Earth of metres of the domain. */
export function lonLatOf(
  place: { readonly lat_deg: number; readonly lon_deg: number },
  sizeM: number,
  x: number,
  y: number,
): LonLat {
  const xi = arcOf(place.lat_deg * RAD) + (y - sizeM / 2) / RADIUS_M;
  const eta = (x - sizeM / 2) / RADIUS_M;
  const u = xi - sum(BETA, (j) => Math.sin(j * xi) * Math.cosh(j * eta));
  const v = eta - sum(BETA, (j) => Math.cos(j * xi) * Math.sinh(j * eta));
  const chi = Math.asin(Math.sin(u) / Math.cosh(v));
  const lat = chi + sum(DELTA, (j) => Math.sin(j * chi));
  const lon = place.lon_deg + Math.atan2(Math.sinh(v), Math.cos(u)) / RAD;
  return { latDeg: lat / RAD, lonDeg: ((((lon + 180) % 360) + 360) % 360) - 180 };
}

/** A place in words: "46.50123° N, 8.25010° E". */
export function lonLatWords({ latDeg, lonDeg }: LonLat): string {
  const ns = latDeg < 0 ? msg("S") : msg("N");
  const ew = lonDeg < 0 ? msg("W") : msg("E");
  return `${fixed(Math.abs(latDeg), 5)}° ${ns}, ${fixed(Math.abs(lonDeg), 5)}° ${ew}`;
}
