//! The check table: published values beside ours, as the server compared them.
import type { Check, CheckRow } from "./api";
import { el } from "./dom";
import { chemistry, digitsFor, numberText, unitText } from "./format";

export function drawCheck(body: HTMLElement, check: Check): void {
  const units = new Set(check.rows.map((row) => row.unit));
  // One unit for all rows goes into the caption; else it stands beside each number.
  const common = units.size === 1 ? unitText([...units][0] ?? "") : undefined;
  const head = el(
    "tr",
    {},
    ...["What", "Published", "Ours", "Difference"].map((title, column) =>
      el("th", { scope: "col", class: column > 0 ? "number" : "" }, title),
    ),
  );
  body.replaceChildren(
    el("p", { class: "muted" }, `Our budget against the published values${common ? `, in ${common}` : ""}.`),
    el(
      "div",
      { class: "table-scroll" },
      el(
        "table",
        { id: "check-table" },
        el("thead", {}, head),
        el("tbody", {}, ...check.rows.map((row) => rowView(row, common === undefined))),
      ),
    ),
    el("p", { class: "muted" }, chemistry(check.note)),
  );
}

function rowView(row: CheckRow, isUnitShown: boolean): HTMLElement {
  // Both values of a row get the same decimals, else two equal numbers look different.
  const digits = digitsFor(Math.max(Math.abs(row.published), Math.abs(row.ours)), 4);
  const unit = isUnitShown ? ` ${unitText(row.unit)}` : "";
  return el(
    "tr",
    {},
    el("th", { scope: "row" }, chemistry(row.what), el("span", { class: "period" }, row.period)),
    el("td", { class: "number" }, numberText(row.published, digits) + unit),
    el("td", { class: "number" }, numberText(row.ours, digits) + unit),
    el("td", { class: "number" }, row.difference_percent === null ? "–" : `${numberText(row.difference_percent, 2)} %`),
  );
}
