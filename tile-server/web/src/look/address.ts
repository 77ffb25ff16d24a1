//! A look in addresses, its own page's and the server's: a look in, named parameters out, and back. The usual look needs none.
import type { Parameter } from "../api/pictures";
import {
  type Look,
  MOST_HEIGHT_M_PER_KG_M2,
  MOST_RELIEF_EXAGGERATION,
  MOST_SEA_OPACITY,
  type Range,
  USUAL,
} from "./look";

/** Largest value that pictures are computed with. */
const MOST_VALUE = 1e20;

/** Parameters of an address that a legend goes by. */
export function colourParameters({ palette, range, scale, reversed }: Look): Parameter[] {
  const all: (Parameter | null)[] = [
    palette === null ? null : ["palette", palette],
    range === null ? null : ["range", `${range.low}:${range.high}`],
    scale === null ? null : ["scale", scale],
    reversed ? ["reverse", "true"] : null,
  ];
  return all.filter((one) => one !== null);
}

/** Parameters of an address that a picture goes by; those that are as usual are left out. */
export function parameters(look: Look): Parameter[] {
  const { relief, reliefExaggeration, seaOpacity, heightMPerKgM2 } = look;
  const isExaggerated = relief !== null && reliefExaggeration !== USUAL.reliefExaggeration;
  const all: (Parameter | null)[] = [
    ...colourParameters(look),
    look.uncertainty ? ["uncertainty", "true"] : null,
    relief === null ? null : ["relief", relief],
    isExaggerated ? ["relief_exaggeration", String(reliefExaggeration)] : null,
    seaOpacity === USUAL.seaOpacity ? null : ["sea_opacity", String(seaOpacity)],
    look.coastlines ? ["coastlines", "true"] : null,
    look.isolines ? ["isolines", "auto"] : null,
    heightMPerKgM2 === USUAL.heightMPerKgM2 ? null : ["height_exaggeration", String(heightMPerKgM2)],
    look.sunOfTime ? ["sun", "time"] : null,
  ];
  return all.filter((one) => one !== null);
}

/** The same for a view of the globe, which has coast lines unless told otherwise. */
export function viewParameters(look: Look): Parameter[] {
  const all = parameters(look);
  return look.coastlines ? all : [...all, ["coastlines", "false"]];
}

/** What one parameter of an address changes; undefined where it says nothing valid. */
export function changeOf(name: string, value: string): Partial<Look> | undefined {
  return READERS.get(name)?.(value);
}

const READERS = new Map<string, (text: string) => Partial<Look> | undefined>([
  ["palette", (text) => (/^[a-z]{1,40}$/.test(text) ? { palette: text } : undefined)],
  ["range", rangeOf],
  ["scale", (text) => (text === "linear" || text === "log" ? { scale: text } : undefined)],
  ["reverse", (text) => (text === "true" ? { reversed: true } : undefined)],
  ["uncertainty", (text) => (text === "true" ? { uncertainty: true } : undefined)],
  ["relief", (text) => (/^[a-z][a-z0-9-]{0,63}$/.test(text) ? { relief: text } : undefined)],
  ["relief_exaggeration", (text) => upTo(MOST_RELIEF_EXAGGERATION, text, (reliefExaggeration) => ({ reliefExaggeration }))],
  ["sea_opacity", (text) => upTo(MOST_SEA_OPACITY, text, (seaOpacity) => ({ seaOpacity }))],
  ["coastlines", (text) => (text === "true" ? { coastlines: true } : undefined)],
  ["isolines", (text) => (text === "auto" ? { isolines: true } : undefined)],
  ["height_exaggeration", (text) => upTo(MOST_HEIGHT_M_PER_KG_M2, text, (heightMPerKgM2) => ({ heightMPerKgM2 }))],
  ["sun", (text) => (text === "time" ? { sunOfTime: true } : undefined)],
]);

/** Two numbers as they were typed; a string result is the reason why they are no range. */
export function parseRange(lowText: string, highText: string): Range | string {
  const [low, high] = [numberOf(lowText), numberOf(highText)];
  if (Number.isNaN(low) || Number.isNaN(high)) return "Both ends of the range must be numbers.";
  if (Math.max(Math.abs(low), Math.abs(high)) > MOST_VALUE) return "These numbers are too large to draw with.";
  if (low >= high) return "The lower end must be below the upper end.";
  return { low, high };
}

function rangeOf(text: string): Partial<Look> | undefined {
  const [low = "", high = ""] = text.split(/:(.*)/s);
  const range = parseRange(low, high);
  return typeof range === "string" ? undefined : { range };
}

function upTo(most: number, text: string, change: (value: number) => Partial<Look>): Partial<Look> | undefined {
  const number = numberOf(text);
  return number >= 0 && number <= most ? change(number) : undefined;
}

/** NaN for what is no number, nothing included. */
function numberOf(text: string): number {
  const trimmed = text.trim();
  return trimmed === "" || !Number.isFinite(Number(trimmed)) ? Number.NaN : Number(trimmed);
}
