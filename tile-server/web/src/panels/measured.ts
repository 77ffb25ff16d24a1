//! Pure sorting of measurements: what one platform measured in, one plottable group for each property and depth out.
import type { Kind, Observation, Quality } from "../api/types";
import { QUALITIES } from "../api/words";
import { chemistry } from "../page/format";

export interface Point {
  /** An instant in milliseconds since 1970, or a depth in m for a cast. */
  readonly x: number;
  readonly value: number;
  readonly quality: Quality;
}

export interface Group {
  /** For people: `sea surface temperature, 1 m`. */
  readonly title: string;
  readonly unit: string;
  /** What the points are plotted over. */
  readonly over: "time" | "depth";
  /** In the order of `x`. */
  readonly points: readonly Point[];
}

/** A cast is one place and time at many depths: it is plotted over depth, everything else over time. */
export function groupsOf(kind: Kind, measured: readonly Observation[]): Group[] {
  const over = kind === "profile" ? "depth" : "time";
  const depths = new Map<string, Set<number>>();
  for (const one of measured) {
    const known = depths.get(one.property) ?? new Set();
    depths.set(one.property, known.add(one.depth_m));
  }
  const groups = new Map<string, { title: string; unit: string; points: Point[] }>();
  for (const one of measured) {
    const isManyDeep = over === "time" && (depths.get(one.property)?.size ?? 0) > 1;
    const title = propertyText(one.property) + (isManyDeep ? `, ${Number(one.depth_m.toFixed(2))} m` : "");
    const key = `${title} ${one.unit}`;
    const group = groups.get(key) ?? { title, unit: one.unit, points: [] };
    group.points.push({
      x: over === "depth" ? one.depth_m : Date.parse(one.time),
      value: one.value,
      quality: one.quality,
    });
    groups.set(key, group);
  }
  return [...groups.values()]
    .map((group) => ({ ...group, over, points: group.points.sort((a, b) => a.x - b.x) }) as Group)
    .sort((a, b) => b.points.length - a.points.length || a.title.localeCompare(b.title));
}

/** `sea_surface_temperature` as words. */
export function propertyText(property: string): string {
  return chemistry(property.replaceAll("_", " "));
}

export function isTrusted(quality: Quality): boolean {
  return quality === "good" || quality === "not_evaluated";
}

/** `11 good, 1 bad`; qualities that are there, best first. */
export function qualityText(points: readonly Point[]): string {
  const parts = QUALITIES.map((quality) => {
    const count = points.filter((point) => point.quality === quality).length;
    return count === 0 ? "" : `${count} ${quality.replaceAll("_", " ")}`;
  });
  return parts.filter((part) => part !== "").join(", ");
}
