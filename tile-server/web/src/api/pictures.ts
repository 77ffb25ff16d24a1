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
  /** The server's name of all that shapes a picture besides: at an address that has it browsers keep what they were answered. */
  readonly edition?: string;
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
  return `${folder}{z}/{x}/{y}.png?${queryOf([...drawn, ...momentOf(version), ...look])}`;
}

/** What tells the pictures of two moments apart. Without an edition it is a number that the server does not read: for caches on the way. */
function momentOf({ edition, revision }: Version): (readonly [name: string, value: string])[] {
  if (edition !== undefined) return [["edition", edition]];
  return revision > 0 ? [["revision", String(revision)]] : [];
}

/** A picture of the globe from a camera. */
export interface GlobeView {
  lon: number;
  lat: number;
  heightKm: number;
  headingDeg: number;
  /** -90 looks straight down. */
  pitchDeg: number;
  rollDeg: number;
  /** Across the shorter side. */
  openingDeg: number;
  timeIso: string;
  width: number;
  height: number;
  /** The newest unless one is named. */
  manifest?: string;
  look: readonly Parameter[];
}

/** Longest side of a picture, pixels, and most pixels of one: the server's limits. */
export const MOST_SIDE_PX = 7680;
export const MOST_PIXELS = 7680 * 4320;
/** Longest side of a picture that follows a camera: a screen's. */
export const MOST_SCREEN_PX = 4096;

/** Below the page's own address, so that it is the same to a server behind a path prefix. Steps are finer than a pixel from the lowest camera. */
export function globePath(product: string, mode: Mode, view: GlobeView): string {
  const query = {
    lon: numberText(view.lon, 5),
    lat: numberText(view.lat, 5),
    height_km: numberText(view.heightKm, 3),
    heading: numberText(view.headingDeg, 3),
    tilt: numberText(90 + view.pitchDeg, 3),
    roll: numberText(view.rollDeg, 3),
    fov: numberText(view.openingDeg, 3),
    time: encodeURIComponent(view.timeIso),
    width: String(view.width),
    height: String(view.height),
    ...(view.manifest === undefined ? {} : { manifest: encodeURIComponent(view.manifest) }),
  } satisfies QueryTexts<"globe_view">;
  return `globe/${encodeURIComponent(product)}/${mode}.png?${queryOf([...Object.entries(query), ...view.look])}`;
}

export function globeUrl(product: string, mode: Mode, view: GlobeView): string {
  return address(globePath(product, mode, view));
}

/** A size of the same shape whose longer side is at most `longest`, and which the server draws. */
export function within(longest: number, width: number, height: number): { width: number; height: number } {
  const part = Math.min(1, longest / Math.max(width, height), Math.sqrt(MOST_PIXELS / (width * height)));
  const wide = Math.max(1, Math.round(width * part));
  // Rounded to the nearest, both sides may come to a few pixels more than there may be.
  const high = Math.min(Math.round(height * part), Math.floor(MOST_PIXELS / wide));
  return { width: wide, height: Math.max(1, high) };
}

function numberText(value: number, digits: number): string {
  // A rounded -0 has no sign.
  return String(Number(value.toFixed(digits)) + 0);
}
