//! Pure geometry of longitude-latitude boxes: corners or typed text in, a box, its text and its outline out. Degrees throughout.
import { wrapLon } from "../page/format";

/** West, south, east, north. West greater than east means that the box crosses the date line. */
export type Bounds = readonly [west: number, south: number, east: number, north: number];

export interface LonLat {
  readonly lon: number;
  readonly lat: number;
}

/** The smaller of the two boxes between the corners: across the date line where that is the short way. */
export function boxFromCorners(a: LonLat, b: LonLat): Bounds {
  const [south, north] = [Math.min(a.lat, b.lat), Math.max(a.lat, b.lat)];
  const eastward = (((b.lon - a.lon) % 360) + 360) % 360;
  const [west, east] = eastward <= 180 ? [a.lon, b.lon] : [b.lon, a.lon];
  return [tidy(wrapLon(west)), tidy(south), tidy(wrapLon(east)), tidy(north)];
}

/** Reads `W,S,E,N`; a string result is the reason why not. */
export function parseBox(text: string): Bounds | string {
  const parts = text.split(/[,;\s]+/).filter((part) => part !== "");
  if (parts.length !== 4) return "Four numbers are needed: west, south, east, north.";
  const numbers = parts.map(Number);
  if (numbers.some((number) => !Number.isFinite(number)))
    return "West, south, east and north must be numbers in degrees.";
  const [west, south, east, north] = numbers as [number, number, number, number];
  if (south < -90 || north > 90) return "Latitudes run from -90 to 90.";
  if (south >= north) return "South must lie below north.";
  if (west < -180 || west > 360 || east < -180 || east > 360) return "Longitudes run from -180 to 180 (or 0 to 360).";
  if (west === east) return "West and east are the same.";
  return [west, south, east, north];
}

export function boxText(box: Bounds): string {
  return box.join(",");
}

export function isWhole(box: Bounds): boolean {
  return box[2] - box[0] >= 360;
}

export function contains(box: Bounds, point: LonLat): boolean {
  const [west, south, east, north] = box;
  if (point.lat < south || point.lat > north) return false;
  if (isWhole(box)) return true;
  const width = (((east - west) % 360) + 360) % 360;
  return (((point.lon - west) % 360) + 360) % 360 <= width;
}

/**
 * Edges of a box as lines with a point at least every `stepDeg`, so that they follow parallels instead of cutting through the
 * globe: one closed line, or the two parallels of a band around the whole globe, whose east and west sides are nowhere.
 */
export function outline(box: Bounds, stepDeg = 2): LonLat[][] {
  const [west, south, , north] = box;
  const width = isWhole(box) ? 360 : (((box[2] - west) % 360) + 360) % 360;
  const across = Math.max(1, Math.ceil(width / stepDeg));
  const up = Math.max(1, Math.ceil((north - south) / stepDeg));
  const parallel = (lat: number): LonLat[] => steps(across).map((part) => ({ lon: west + width * part, lat }));
  const meridian = (lon: number): LonLat[] => steps(up).map((part) => ({ lon, lat: south + (north - south) * part }));
  if (isWhole(box)) return [south, north].filter((lat) => Math.abs(lat) < 90).map(parallel);
  return [
    [
      ...parallel(south),
      ...meridian(west + width).slice(1),
      ...parallel(north).reverse().slice(1),
      ...meridian(west).reverse().slice(1),
    ],
  ];
}

/** 0 to 1 in `count` equal steps, both ends included. */
function steps(count: number): number[] {
  return [...Array(count + 1).keys()].map((i) => i / count);
}

function tidy(degrees: number): number {
  return Math.round(degrees * 100) / 100;
}

/** A line in degrees with places between its own ones, at most `stepDeg` apart in longitude and latitude. */
export function denseLine(line: readonly [number, number][], stepDeg: number): [number, number][] {
  const dense: [number, number][] = [];
  for (const [index, [lon, lat]] of line.entries()) {
    const before = line[index - 1];
    if (before) {
      const parts = Math.ceil(Math.max(Math.abs(lon - before[0]), Math.abs(lat - before[1])) / stepDeg);
      for (let part = 1; part < parts; part++) {
        const share = part / parts;
        dense.push([before[0] + share * (lon - before[0]), before[1] + share * (lat - before[1])]);
      }
    }
    dense.push([lon, lat]);
  }
  return dense;
}
