//! The mean over a region of what is no flux: an answer in; its words, its values in time and a table out.
import type { RegionMeans } from "../api/types";
import { el } from "../page/dom";
import { alikeText, areaText, numberText, unitText } from "../page/format";
import { holdsAt } from "../state/catalogue";
import { manifestLine } from "./manifest";
import type { Sample } from "./series";

/** Means at the instants that they are those of. */
export function meanSamples({ quantity, series }: Pick<RegionMeans, "quantity" | "series">): Sample[] {
  const holds = holdsAt(quantity);
  return series.map((row) => ({ atMs: Date.parse(row[holds]), value: row.mean }));
}

/** `plot` is where the chart comes. */
export function meanView(answer: RegionMeans, title: string, plot: HTMLElement, jsonUrl: string): HTMLElement[] {
  const unit = unitText(answer.unit);
  const coverages = answer.series.map((row) => row.coverage_percent);
  const [least, most] = [Math.min(...coverages), Math.max(...coverages)].map((share) => numberText(share, 1));
  return [
    el("p", { class: "muted" }, "No flux, and so no budget: this is the mean by area, period by period."),
    el(
      "p",
      { class: "muted", id: "mean-coverage" },
      `${title}: ${areaText(answer.region_area_m2)}, ${areaText(answer.ocean_area_m2)} of it sea, ` +
        `of which ${least === most ? least : `${least} to ${most}`} % hold data.`,
    ),
    ...answer.notes.map((note) => el("p", { class: "problem" }, note)),
    plot,
    manifestLine(answer.manifest),
    el(
      "div",
      { class: "row actions" },
      el("a", { class: "button", href: jsonUrl, target: "_blank", rel: "noopener" }, "JSON"),
    ),
    el("details", {}, el("summary", {}, "All periods"), table(answer, unit)),
  ];
}

function table({ series }: RegionMeans, unit: string): HTMLElement {
  const head = el("tr", {}, ...["From", "To", unit, "Coverage"].map((title) => el("th", { scope: "col" }, title)));
  const largest = Math.max(0, ...series.map((row) => Math.abs(row.mean ?? 0)));
  const rows = series.map((row) =>
    el(
      "tr",
      {},
      el("td", {}, row.start.slice(0, 10)),
      el("td", {}, row.end.slice(0, 10)),
      el("td", { class: "number" }, alikeText(row.mean, largest)),
      el("td", { class: "number" }, `${numberText(row.coverage_percent, 1)} %`),
    ),
  );
  return el(
    "div",
    { class: "table-scroll" },
    el("table", { id: "mean-table" }, el("thead", {}, head), el("tbody", {}, ...rows)),
  );
}
