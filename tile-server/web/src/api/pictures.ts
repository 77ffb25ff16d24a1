//! Addresses of pictures: a layer or a view and the parameters of its look in, the address of its tiles or its image out.
import { address } from "./client";
import type { Mode, Query, QueryTexts } from "./types";

/** A parameter of a picture's address. */
export type Parameter = readonly [name: keyof Query<"tile">, value: string];

/** Which data is drawn. It is a part of a tile's address, so that no cache on the way answers with older pictures. */
export interface Version {
  readonly manifest: string;
  /** Rises when the same version looks different: what lifts its particles comes later than it. */
  readonly revision: number;
}

/** `name=value&…`; of the values' letters only those of numbers, names and ranges occur, which addresses carry as they are. */
export function queryOf(parameters: readonly (readonly [name: string, value: string])[]): string {
  return parameters.map(([name, value]) => `${name}=${value}`).join("&");
}

/** `{z}`, `{x}` and `{y}` are left for the imagery provider to fill. */
export function tileTemplate(
  product: string,
  mode: Mode,
  timeIso: string,
  version: Version,
  look: readonly Parameter[] = [],
): string {
  const folder = address(`tiles/${encodeURIComponent(product)}/${mode}/`);
  const drawn: readonly Parameter[] = [
    ["time", encodeURIComponent(timeIso)],
    ["manifest", encodeURIComponent(version.manifest)],
  ];
  // The server does not read it: it tells the pictures of two moments apart for caches on the way.
  const revision = version.revision > 0 ? [["revision", String(version.revision)] as const] : [];
  return `${folder}{z}/{x}/{y}.png?${queryOf([...drawn, ...revision, ...look])}`;
}

export interface GlobeView {
  lon: number;
  lat: number;
  heightKm: number;
  headingDeg: number;
  /** -90 looks straight down. */
  pitchDeg: number;
  timeIso: string;
  width: number;
  height: number;
  look: readonly Parameter[];
}

export function globeUrl(product: string, mode: Mode, view: GlobeView): string {
  const query = {
    lon: view.lon.toFixed(4),
    lat: view.lat.toFixed(4),
    height_km: view.heightKm.toFixed(1),
    heading: view.headingDeg.toFixed(2),
    tilt: (90 + view.pitchDeg).toFixed(2),
    time: view.timeIso,
    width: String(view.width),
    height: String(view.height),
  } satisfies QueryTexts<"globe_view">;
  return address(`globe/${encodeURIComponent(product)}/${mode}.png`, { ...query, ...Object.fromEntries(view.look) });
}
