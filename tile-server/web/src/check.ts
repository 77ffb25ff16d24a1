//! The check table: published values beside ours, as the server compared them.
import type { Check, CheckRow } from "./api";
import { el } from "./dom";
import { chemistry, digitsFor, numberText, unitText } from "./format";

export function drawCheck(body: HTMLElement, check: Check): void {
  const head = ["What", "Published", "Ours", "Difference"].map((title, column) =>
    el("th", { scope: "col", class: column > 0 ? "number" : "" }, title),
  );
  const digits = digitsByUnit(check.rows);
  const rows = check.rows.map((row) => rowView(row, digits.get(row.unit) ?? 0));
  body.replaceChildren(
    el("p", { class: "muted" }, "Our budgets beside the published ones, positive out of the sea."),
    el(
      "div",
      { class: "table-scroll" },
      el("table", { id: "check-table" }, el("thead", {}, el("tr", {}, ...head)), el("tbody", {}, ...rows)),
    ),
    el("p", { class: "muted" }, chemistry(check.note)),
  );
}

/** Rows of one unit get the same decimals, else two equal numbers look different. */
function digitsByUnit(rows: readonly CheckRow[]): Map<string, number> {
  const largest = new Map<string, number>();
  for (const { unit, published, ours } of rows) {
    largest.set(unit, Math.max(largest.get(unit) ?? 0, Math.abs(published), Math.abs(ours)));
  }
  return new Map([...largest].map(([unit, magnitude]) => [unit, digitsFor(magnitude, 4)]));
}

function rowView(row: CheckRow, digits: number): HTMLElement {
  return el(
    "tr",
    {},
    el(
      "th",
      { scope: "row" },
      chemistry(row.what),
      el("span", { class: "period" }, `${row.period}, ${unitText(row.unit)}`),
    ),
    el("td", { class: "number" }, numberText(row.published, digits)),
    el("td", { class: "number" }, numberText(row.ours, digits)),
    el("td", { class: "number" }, row.difference_percent === null ? "–" : `${numberText(row.difference_percent, 2)} %`),
  );
}
