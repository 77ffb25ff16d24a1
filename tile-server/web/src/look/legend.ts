//! The colour bar: a product's legend in, a bar with ticks and unit out.
import type { Legend } from "../api/types";
import { el } from "../page/dom";
import { chemistry, digitsFor, numberText, unitText } from "../page/format";

const MOST_TICKS = 6;

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
  const isLog = legend.scale === "log";
  const digits = Math.max(...ticks.map((tick) => fractionDigits(tick, legend.high - legend.low)));
  // On a logarithmic scale each number is as short as it is: 0.03 and 10.
  const digitsOf = (tick: number) => (isLog ? fractionDigits(tick, tick) : digits);
  const bar = el("div", { class: "legend-bar", "aria-hidden": "true" });
  bar.style.background = gradientOf(legend);
  const axis = el("div", { class: "legend-axis" });
  for (const tick of ticks) {
    const mark = el("span", { class: "legend-tick" }, numberText(tick, digitsOf(tick)));
    mark.style.left = `${(placeOf(legend, tick) * 100).toFixed(3)}%`;
    axis.append(mark);
  }
  const unit = unitText(legend.unit);
  return el(
    "figure",
    {
      class: "legend",
      id: "legend",
      role: "group",
      "aria-label": `Colours from ${numberText(legend.low, digitsOf(legend.low))} to ${numberText(legend.high, digitsOf(legend.high))} ${unit}`,
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

function fractionDigits(value: number, span: number): number {
  const most = digitsFor(span, 3);
  return (
    [...Array(most + 1).keys()].find((digits) => Math.abs(Number(value.toFixed(digits)) - value) < span * 1e-6) ?? most
  );
}
