//! The colour bar: a product's legend in, a bar with ticks and unit out.
import type { Legend } from "../api/types";
import { el } from "../page/dom";
import { chemistry, exponentText, numberText, unitText } from "../page/format";

const MOST_TICKS = 6;
/** Decimals that are written out; what needs more is written with an exponent. */
const MOST_DECIMALS = 5;
/** Numbers below this are written out. */
const MOST_WRITTEN = 1e6;
/** Figures beside an exponent. */
const MOST_FIGURES = 6;
/** Figures of the ends of a range that is read out. */
const END_FIGURES = 4;

/** Round numbers from `low` to `high`, at most `most` of them, both ends inclusive where they are round. */
export function ticksOf(low: number, high: number, most = MOST_TICKS): number[] {
  const span = high - low;
  if (!(span > 0)) return [low];
  const rough = span / (most - 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step =
    [1, 2, 2.5, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= rough * 0.999) ?? 10 * power;
  const ticks: number[] = [];
  for (let i = Math.ceil(low / step - 1e-9) + 0; i * step <= high + step * 1e-9; i++) ticks.push(i * step);
  return ticks;
}

/** The values with as many decimals as any of them needs, as the server's drawn legends have them. */
export function tickTexts(ticks: readonly number[]): string[] {
  const largest = Math.max(0, ...ticks.map(Math.abs));
  const isEnough = (tick: number, digits: number) => Math.abs(Number(tick.toFixed(digits)) - tick) <= largest * 1e-9;
  const decimals = [...Array(MOST_DECIMALS + 1).keys()];
  const needed = ticks.map((tick) => decimals.find((digits) => isEnough(tick, digits)) ?? Number.POSITIVE_INFINITY);
  const digits = Math.max(0, ...needed);
  const isWritten = Number.isFinite(digits) && largest < MOST_WRITTEN;
  return ticks.map((tick) => (isWritten ? numberText(tick, digits) : exponentText(tick, MOST_FIGURES)));
}

export function gradientOf({ stops }: Pick<Legend, "stops">): string {
  return `linear-gradient(to right, ${stops.map(([at, colour]) => `${colour} ${(at * 100).toFixed(2)}%`).join(", ")})`;
}

/** Where a value lies on the bar, 0 to 1. */
export function placeOf({ low, high, scale }: Pick<Legend, "low" | "high" | "scale">, value: number): number {
  const at = scale === "log" ? Math.log10 : (each: number) => each;
  return (at(value) - at(low)) / (at(high) - at(low));
}

export function legendView(legend: Legend): HTMLElement {
  // Older servers do not say.
  const ticks = legend.ticks ?? ticksOf(legend.low, legend.high);
  // On a logarithmic scale each number is as short as it is: 0.03 and 10.
  const texts = legend.scale === "log" ? ticks.flatMap((tick) => tickTexts([tick])) : tickTexts(ticks);
  const [from, to] = [legend.low, legend.high].map((end) => tickTexts([Number(end.toPrecision(END_FIGURES))]).join());
  const bar = el("div", { class: "legend-bar", "aria-hidden": "true" });
  bar.style.background = gradientOf(legend);
  const axis = el("div", { class: "legend-axis" });
  ticks.forEach((tick, index) => {
    const mark = el("span", { class: "legend-tick" }, texts[index]);
    mark.style.left = `${(placeOf(legend, tick) * 100).toFixed(3)}%`;
    axis.append(mark);
  });
  const unit = unitText(legend.unit);
  return el(
    "figure",
    {
      class: "legend",
      id: "legend",
      role: "group",
      "aria-label": `Colours from ${from} to ${to} ${unit}`,
    },
    el(
      "figcaption",
      {},
      el("span", { class: "legend-label" }, chemistry(legend.label)),
      el("span", { class: "legend-unit" }, unit),
    ),
    bar,
    axis,
  );
}
