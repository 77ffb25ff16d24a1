//! The legend of a mask: a legend's colours and the codes in, a swatch a code with its meaning out.
import type { Flag, Legend } from "../api/types";
import { el } from "../page/dom";
import { chemistry } from "../page/format";
import { placeOf } from "./legend";

/** Colours that pictures are drawn with, from the first to the last of a bar. */
const COLOUR_COUNT = 256;

/** The colour that pictures show a value in, as CSS spells it: a whole step of the bar, its ends beyond its range. */
export function colourOf(legend: Pick<Legend, "low" | "high" | "scale" | "stops">, value: number): string {
  const place = placeOf(legend, value);
  // A logarithm of 0 or less is no number, or below all of them.
  const within = Math.min(Math.max(Number.isNaN(place) ? 0 : place, 0), 1);
  const at = Math.round(within * (COLOUR_COUNT - 1)) / (COLOUR_COUNT - 1);
  const next = legend.stops.findIndex(([stop]) => stop >= at);
  const [to, toColour] = legend.stops[next] ?? legend.stops.at(-1) ?? [1, "#000000"];
  const [from, fromColour] = legend.stops[next - 1] ?? [to, toColour];
  const part = to > from ? (at - from) / (to - from) : 1;
  const [a, b] = [channels(fromColour), channels(toColour)];
  return `rgb(${a.map((low, index) => Math.round(low + ((b[index] ?? low) - low) * part)).join(", ")})`;
}

/** `#rrggbb` as three numbers, 0 to 255. */
function channels(colour: string): number[] {
  return [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16));
}

/** Meanings are single words in files: `open_ocean` is read as two. */
export function meaningText({ meaning }: Flag): string {
  return meaning.replaceAll("_", " ");
}

/** Between two codes there is nothing, so that a bar would show colours that no picture has. */
export function codesView(legend: Legend, flags: readonly Flag[]): HTMLElement {
  const list = el("ul", { class: "legend-codes", tabindex: "0", "aria-label": "Codes" });
  for (const flag of flags) {
    const swatch = el("span", { class: "legend-swatch", "aria-hidden": "true" });
    swatch.style.background = colourOf(legend, flag.value);
    const text = meaningText(flag);
    list.append(
      el("li", { title: `${flag.value}: ${flag.meaning}` }, swatch, el("span", { class: "legend-code" }, String(flag.value)), text),
    );
  }
  return el(
    "figure",
    { class: "legend", id: "legend", role: "group", "aria-label": `Colours of ${flags.length} codes` },
    el("figcaption", {}, el("span", { class: "legend-label" }, chemistry(legend.label))),
    list,
  );
}
