//! The address bar's hash: a state in, a short readable text out, and back, so that a view can be shared as a link.
import { queryOf } from "../api/pictures";
import type { Mode } from "../api/types";
import { MODES } from "../api/words";
import { changeOf, parameters } from "../look/address";
import { USUAL } from "../look/look";
import { wrapLon } from "../page/format";
import { toIso } from "../time/steps";
import type { CameraView, Place } from "./camera";
import { type State, type Tab, TABS } from "./store";

export function encodeHash(state: Readonly<State>): string {
  const parts: string[] = [];
  if (state.product !== null) parts.push(`product=${encodeURIComponent(state.product)}`);
  parts.push(`mode=${state.mode}`);
  if (Number.isFinite(state.timeMs)) parts.push(`time=${toIso(state.timeMs)}`);
  parts.push(`camera=${cameraText(state.camera)}`);
  if (state.opacity !== 0.9) parts.push(`opacity=${round(state.opacity, 2)}`);
  const look = queryOf(parameters(state.look));
  if (look !== "") parts.push(look);
  if (state.place) parts.push(`place=${round(state.place.lon, 3)},${round(state.place.lat, 3)}`);
  if (state.tab && TABS.includes(state.tab)) parts.push(`tab=${state.tab}`);
  if (state.region !== "global") parts.push(`region=${encodeURIComponent(state.region)}`);
  if (state.observations) parts.push("observations=on");
  if (!state.live) parts.push("live=off");
  return `#${parts.join("&")}`;
}

/** Only what the text says validly; anything else is left to the caller's defaults. */
export function decodeHash(hash: string): Partial<State> {
  const found: Partial<State> = {};
  for (const part of hash.replace(/^#/, "").split("&")) {
    const cut = part.indexOf("=");
    if (cut < 1) continue;
    const value = decoded(part.slice(cut + 1));
    if (value !== undefined) read(part.slice(0, cut), value, found);
  }
  return found;
}

function read(key: string, value: string, found: Partial<State>): void {
  if (key === "product" && value !== "") found.product = value;
  else if (key === "mode" && MODES.includes(value as Mode)) found.mode = value as Mode;
  else if (key === "time") assign(found, "timeMs", instantOf(value));
  else if (key === "camera") assign(found, "camera", cameraOf(value));
  else if (key === "opacity" && value !== "" && Number(value) >= 0 && Number(value) <= 1) found.opacity = Number(value);
  else if (key === "place") assign(found, "place", placeOf(value));
  else if (key === "tab" && TABS.includes(value as Tab)) found.tab = value as Tab;
  else if (key === "observations" && value === "on") found.observations = true;
  else if (key === "live" && (value === "on" || value === "off")) found.live = value === "on";
  else if (key === "region" && value !== "") found.region = value;
  else {
    const change = changeOf(key, value);
    if (change) found.look = { ...(found.look ?? USUAL), ...change };
  }
}

function assign<K extends keyof State>(found: Partial<State>, key: K, value: State[K] | undefined): void {
  if (value !== undefined) found[key] = value;
}

function cameraText(camera: CameraView): string {
  const fields = [round(camera.lon, 3), round(camera.lat, 3), round(camera.heightKm, 1)];
  const [headingDeg, pitchDeg, rollDeg] = [camera.headingDeg, camera.pitchDeg, camera.rollDeg].map((angle) => round(angle, 1));
  if (rollDeg !== 0) return [...fields, headingDeg, pitchDeg, rollDeg].join(",");
  const isStraightDown = (headingDeg ?? 0) % 360 === 0 && pitchDeg === -90;
  return (isStraightDown ? fields : [...fields, headingDeg, pitchDeg]).join(",");
}

function cameraOf(text: string): CameraView | undefined {
  const numbers = text.split(",").map(Number);
  const [lon, lat, heightKm, headingDeg = 0, pitchDeg = -90, rollDeg = 0] = numbers;
  if (numbers.length < 3 || numbers.some((number) => !Number.isFinite(number))) return undefined;
  if (lon === undefined || lat === undefined || heightKm === undefined) return undefined;
  if (Math.abs(lat) > 90 || heightKm <= 0 || heightKm > 200_000) return undefined;
  return { lon: wrapLon(lon), lat, heightKm, headingDeg, pitchDeg, rollDeg };
}

/** A year, month, day or instant of ISO 8601: browsers take much else for a date, and what has no offset for one of the reader's own clock. */
function instantOf(text: string): number | undefined {
  const found = /^\d{4}(?:-\d{2}(?:-\d{2}(T\d{2}:\d{2}(?::\d{2}(?:\.\d+)?)?(Z|[+-]\d{2}:\d{2})?)?)?)?$/.exec(text);
  if (!found) return undefined;
  const [, time, offset] = found;
  const timeMs = Date.parse(time !== undefined && offset === undefined ? `${text}Z` : text);
  return Number.isFinite(timeMs) ? timeMs : undefined;
}

function placeOf(text: string): Place | undefined {
  const [lon, lat, ...rest] = text.split(",").map(Number);
  if (lon === undefined || lat === undefined || rest.length > 0) return undefined;
  return Number.isFinite(lon) && Math.abs(lat) <= 90 ? { lon: wrapLon(lon), lat } : undefined;
}

function decoded(text: string): string | undefined {
  try {
    return decodeURIComponent(text);
  } catch {
    return undefined;
  }
}

function round(value: number, digits: number): number {
  return Number(value.toFixed(digits));
}
