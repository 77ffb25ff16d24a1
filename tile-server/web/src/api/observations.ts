//! The server's observations, typed: which platforms there are and what one of them measured.
import { address, getJson } from "./api";

export const KINDS = ["buoy", "ship", "station", "profile"] as const;
export type Kind = (typeof KINDS)[number];

/** Best first. */
export const QUALITIES = ["good", "not_evaluated", "questionable", "bad"] as const;
export type Quality = (typeof QUALITIES)[number];

type Position = [lon: number, lat: number];

export interface Platform {
  id: string;
  geometry: { type: "Point"; coordinates: Position } | { type: "MultiLineString"; coordinates: Position[][] };
  properties: {
    dataset: string;
    platform: string;
    kind: Kind;
    first: string;
    last: string;
    lon: number;
    lat: number;
    properties: string[];
    count: number;
  };
}

export interface Measured {
  time: string;
  lon: number;
  lat: number;
  depth_m: number;
  property: string;
  value: number;
  unit: string;
  quality: Quality;
}

export interface MeasuredSeries {
  dataset: string;
  platform: string;
  series: Measured[];
  next: string | null;
}

/** Answers of one series; a plot of more values than these hold would not show more. */
const MOST_PAGES = 5;

export const platforms = (signal: AbortSignal) =>
  getJson<{ features: Platform[] }>(address("api/observations/platforms"), signal).then((body) => body.features);

export function seriesUrl(dataset: string, platform: string, query: Record<string, string> = {}): string {
  return address(`api/observations/${encodeURIComponent(dataset)}/${encodeURIComponent(platform)}`, query);
}

/** All pages of a series, or the first ones where there are very many; `next` is then where to go on. */
export async function series(dataset: string, platform: string, signal: AbortSignal): Promise<MeasuredSeries> {
  const all: Measured[] = [];
  let after: string | null = null;
  for (let page = 0; page < MOST_PAGES; page++) {
    const answer: MeasuredSeries = await getJson(
      seriesUrl(dataset, platform, after === null ? {} : { after }),
      signal,
    );
    all.push(...answer.series);
    after = answer.next;
    if (after === null) break;
  }
  return { dataset, platform, series: all, next: after };
}

/** `3 buoys, 1 ship`; the kinds that are there, in their order. */
export function countText(found: readonly Platform[]): string {
  const parts = KINDS.map((kind) => {
    const count = found.filter((platform) => platform.properties.kind === kind).length;
    return count === 0 ? "" : `${count} ${kind}${count === 1 ? "" : "s"}`;
  });
  return parts.filter((part) => part !== "").join(", ") || "none here";
}
