//! The check table: published values beside ours, as the server compared them.
import type { Check, CheckRow } from "./api";
import { el } from "./dom";
import { digitsFor, numberText, unitText } from "./format";

export function drawCheck(body: HTMLElement, check: Check): void {
  const head = el("tr", {}, ...["What", "Period", "Published", "Ours", "Difference"].map((title) => el("th", { scope: "col" }, title)));
  body.replaceChildren(
    el("p", { class: "muted" }, "Our budget against the published values."),
    el("div", { class: "table-scroll" }, el("table", { id: "check-table" }, el("thead", {}, head), el("tbody", {}, ...check.rows.map(rowView)))),
    el("p", { class: "muted" }, check.note));
}

function rowView(row: CheckRow): HTMLElement {
  // Both values of a row get the same decimals, else two equal numbers look different.
  const digits = digitsFor(Math.max(Math.abs(row.published), Math.abs(row.ours)), 4);
  const unit = unitText(row.unit);
  return el("tr", {},
    el("th", { scope: "row" }, row.what),
    el("td", {}, row.period),
    el("td", { class: "number" }, `${numberText(row.published, digits)} ${unit}`),
    el("td", { class: "number" }, `${numberText(row.ours, digits)} ${unit}`),
    el("td", { class: "number" }, row.difference_percent === null ? "–" : `${numberText(row.difference_percent, 2)} %`));
}
