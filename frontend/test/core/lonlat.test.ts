// SPEC N30
import { describe, expect, it } from "vitest";
import { lonLatOf, lonLatWords } from "../../src/core/lonlat.ts";

/** Place, size, x, y, and what PROJ says of the terrain's frame (`frame` of importing/placement/fitting.py): latitude, longitude. */
const PROJ: readonly (readonly number[])[] = [
  [46.5, 8.25, 4096, 0, 0, 46.481573147, 8.223329347],
  [46.5, 8.25, 4096, 4096, 4096, 46.518420571, 8.276688676],
  [46.5, 8.25, 4096, 1000, 3000, 46.508563327, 8.236345373],
  [-33.9, 151.2, 65536, 0, 65536, -33.604070564, 150.846940024],
  [-33.9, 151.2, 65536, 65536, 0, -34.194896413, 151.555503554],
  [70.0, -179.9, 30000, 0, 0, 69.865114658, 179.709710468],
  [70.0, -179.9, 30000, 30000, 15000, 69.999566905, -179.507197242],
  [0.0, 0.0, 1000, 500, 500, 0, 0],
];

describe("longitude and latitude", () => {
  it("are PROJ's to a millimetre", () => {
    for (const [lat, lon, size, x, y, wantedLat, wantedLon] of PROJ) {
      const found = lonLatOf({ lat_deg: lat!, lon_deg: lon! }, size!, x!, y!);
      expect(Math.abs(found.latDeg - wantedLat!)).toBeLessThan(1e-8);
      expect(Math.abs(found.lonDeg - wantedLon!)).toBeLessThan(1e-8);
    }
  });

  it("have words", () => {
    expect(lonLatWords({ latDeg: -33.5, lonDeg: 8.25 })).toBe("33.50000° S, 8.25000° E");
  });
});
