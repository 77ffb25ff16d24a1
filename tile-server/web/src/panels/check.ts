//! The check table: what the paper says, what another program makes of its grid, what we say.
import type { Check, CheckPaper, CheckRow } from "../api/types";
import { el } from "../page/dom";
import { alikeText, chemistry, numberText, unitText } from "../page/format";

export function drawCheck(body: HTMLElement, check: Check): void {
  const head = ["Paper", "Independent", "Fluxglobe"].map((title) => el("th", { scope: "col", class: "number" }, title));
  const largest = largestByUnit(check.rows);
  const rows = check.rows.map((row) => rowView(row, largest.get(row.unit) ?? 0));
  body.replaceChildren(
    el("p", { class: "muted" }, "Budgets by three hands, positive out of the sea."),
    el(
      "div",
      { class: "table-scroll" },
      el("table", { id: "check-table" }, el("thead", {}, el("tr", {}, ...head)), ...rows),
    ),
    el("p", { class: "muted" }, "Paper: ", chemistry(check.note)),
    el("p", { class: "muted" }, chemistry(check.method)),
  );
}

/** Rows of one unit get the same decimals, else two equal numbers look different. */
function largestByUnit(rows: readonly CheckRow[]): Map<string, number> {
  const largest = new Map<string, number>();
  for (const { unit, independent, ours } of rows) {
    largest.set(unit, Math.max(largest.get(unit) ?? 0, Math.abs(independent), Math.abs(ours)));
  }
  return largest;
}

/** A printed number with the decimals and the uncertainty that the paper gives it. */
export function statedText(paper: CheckPaper | null): string {
  if (paper === null) return "–";
  const { value, uncertainty, decimals } = paper.stated;
  const text = numberText(value, decimals);
  return uncertainty === null ? text : `${text} ± ${numberText(uncertainty, decimals)}`;
}

/** Only the paper's own uncertainty says that a number lies within it; a difference without one is shown as it is. */
export function verdictText(row: CheckRow): string {
  const { paper } = row;
  const texts: string[] = [];
  if (paper !== null) {
    const sign = paper.difference > 0 ? "+" : "";
    const difference = sign + numberText(paper.difference, 3);
    texts.push(`${paper.verdict.replaceAll("_", " ")} (${difference})`);
  }
  if (!row.agrees) texts.push("off the independent number");
  return texts.join("; ");
}

/** What it is has a line of its own: beside three numbers there is no room for it. */
function rowView(row: CheckRow, largest: number): HTMLElement {
  const verdict = verdictText(row);
  const words = [`${row.period}, ${unitText(row.unit)}`, row.paper ? `against the paper: ${verdict}` : verdict];
  const what = el(
    "th",
    { scope: "rowgroup", colspan: "3" },
    chemistry(row.what),
    el("span", { class: "period" }, words.filter((word) => word !== "").join("; ")),
  );
  const numbers = [statedText(row.paper), alikeText(row.independent, largest), alikeText(row.ours, largest)];
  return el("tbody", {}, el("tr", {}, what), el("tr", {}, ...numbers.map((text) => el("td", { class: "number" }, text))));
}
