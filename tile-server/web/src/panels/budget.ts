//! The budget panel: region, period and earth in; total, coverage, bars, a table and citable downloads out; of what is no flux, means.
import { ApiError } from "../api/client";
import * as api from "../api/requests";
import type { Budget, BudgetQuery, BudgetRow, Cells, Region, RegionMeans } from "../api/types";
import type { Bounds } from "../globe/box";
import { el, icon, saveText } from "../page/dom";
import { alikeText, areaText, digitsFor, numberText, unitText, valueText } from "../page/format";
import { DOWNLOAD } from "../page/icons";
import type { Store } from "../state/store";
import { clampToRange, quantise, rangeOf, type Step } from "../time/steps";
import { BudgetForm } from "./budget-form";
import { barChart, type Chart, seriesChart } from "./chart";
import { budgetCsv } from "./csv";
import { manifestLine } from "./manifest";
import { meanSamples, meanView } from "./region-mean";

const TG_PER_PG = 1000;

export interface BudgetContext {
  store: Store;
  /** The product on show is a flux; of anything else there is no budget to ask for, but a mean. */
  isFlux: () => boolean;
  /** There is something between two of its values: codes and directions have no mean either. */
  hasMean: () => boolean;
  drawBox: (onChange: (box: Bounds) => void, onEnd: (box: Bounds | undefined) => void) => void;
  markRegion: (box: Bounds | null) => void;
  onError: (key: string, error: unknown) => void;
}

export class BudgetPanel {
  readonly #context: BudgetContext;
  readonly #form: BudgetForm;
  readonly #result = el("div", { class: "budget-result", "aria-live": "polite" });
  #asked: AbortController | undefined;
  #chart: Chart | undefined;
  #steps: readonly Step[] = [];
  /** What the result in sight answers, so that opening the panel again asks nothing twice. */
  #answered = "";

  constructor(body: HTMLElement, context: BudgetContext) {
    this.#context = context;
    this.#form = new BudgetForm({
      onChange: () => void this.refresh(),
      onRegion: (region) => context.store.set({ region }),
      drawBox: context.drawBox,
      markRegion: context.markRegion,
    });
    body.append(this.#form.element, this.#result);
    // A new product comes with its steps, through `setSteps`.
    context.store.on(["region", "tab"], () => void this.refresh());
    context.store.on(["timeMs"], ({ timeMs }) => this.#chart?.setNow(timeMs));
  }

  setRegions(regions: readonly Region[]): void {
    this.#form.setRegions(regions, this.#context.store.state.region);
  }

  setSteps(product: string, steps: readonly Step[]): void {
    this.#steps = steps;
    this.#form.setSteps(product, steps);
    this.#answered = "";
    void this.refresh();
  }

  /** There is a newer version: asks again what is shown. */
  async renew(): Promise<void> {
    this.#answered = "";
    await this.refresh();
  }

  /** Asks only while the panel is open: a budget is work for the server. */
  async refresh(): Promise<void> {
    const { product, region, tab } = this.#context.store.state;
    const isOpen = tab === "budget";
    this.#context.markRegion(isOpen ? this.#form.boundsOf(region) : null);
    this.#form.show(region);
    const isFlux = this.#context.isFlux();
    this.#form.showSumFields(isFlux);
    if (isOpen && !isFlux && !this.#context.hasMean()) {
      this.#say("Budgets are sums of a carbon flux; this product is none, and its values have no mean. Choose another to see one.");
      return;
    }
    const query = isOpen && product !== null ? this.#form.query(region) : undefined;
    if (!query || product === null) return;
    const key = isFlux ? api.budgetUrl(product, query) : api.areaUrl(product, query);
    if (key === this.#answered) return;
    this.#answered = key;
    this.#asked?.abort();
    const asked = new AbortController();
    this.#asked = asked;
    this.#result.classList.add("waiting");
    if (!this.#result.hasChildNodes()) this.#result.append(el("p", { class: "muted busy-line" }, "Adding up …"));
    try {
      if (!isFlux) {
        const means = await api.area(product, query, asked.signal);
        if (!asked.signal.aborted) this.#drawMeans(means, key);
        return;
      }
      const [rows, total] = await Promise.all([
        api.budget(product, query, asked.signal),
        api.budget(product, { ...query, step: "total" }, asked.signal),
      ]);
      if (!asked.signal.aborted) this.#draw(query, rows, total, key);
    } catch (error) {
      if (asked.signal.aborted) return;
      this.#say(error instanceof Error ? error.message : String(error));
      if (error instanceof ApiError && error.kind === "unreachable") this.#context.onError("budget", error);
    } finally {
      if (this.#asked === asked) this.#result.classList.remove("waiting");
    }
  }

  /** A reason in place of a result. */
  #say(problem: string): void {
    this.#asked?.abort();
    this.#answered = "";
    this.#chart?.destroy();
    this.#chart = undefined;
    this.#result.classList.remove("waiting");
    this.#result.replaceChildren(el("p", { class: "problem" }, problem));
  }

  #drawMeans(answer: RegionMeans, jsonUrl: string): void {
    this.#chart?.destroy();
    this.#chart = undefined;
    const unit = unitText(answer.unit);
    const plot = el("div", {
      class: "plot",
      id: "mean-plot",
      role: "img",
      "data-points": String(answer.series.length),
      "aria-label": `Mean of ${answer.series.length} periods in ${unit}`,
    });
    this.#result.replaceChildren(...meanView(answer, this.#form.titleOf(answer.region), plot, jsonUrl));
    const { store } = this.#context;
    const range = rangeOf(this.#steps) ?? { startMs: 0, endMs: 1 };
    this.#chart = seriesChart(plot, meanSamples(answer), range, unit, (timeMs) => {
      store.set({ timeMs: quantise(this.#steps, clampToRange(this.#steps, timeMs)) });
    });
    this.#chart.setNow(store.state.timeMs);
  }

  #draw(query: BudgetQuery, answer: Budget, total: Budget, jsonUrl: string): void {
    this.#chart?.destroy();
    const unit = unitText(answer.unit);
    const plot = el("div", {
      class: "plot",
      id: "budget-plot",
      role: "img",
      "aria-label": `Budget of ${answer.rows.length} periods in ${unit}`,
    });
    this.#result.replaceChildren(
      ...this.#headline(total, unit),
      plot,
      manifestLine(answer.manifest),
      el(
        "div",
        { class: "row actions" },
        el(
          "button",
          {
            type: "button",
            onclick: () =>
              saveText(
                `${answer.product}-budget-${answer.region.replace(/[^\w.-]+/g, "_")}.csv`,
                "text/csv",
                budgetCsv(answer),
              ),
          },
          icon(DOWNLOAD),
          "CSV",
        ),
        el("a", { class: "button", href: jsonUrl, target: "_blank", rel: "noopener" }, "JSON"),
      ),
      el("details", {}, el("summary", {}, "All periods"), table(answer, unit)),
    );
    const rows = answer.rows.map((row) => ({
      startMs: Date.parse(row.start),
      endMs: Date.parse(row.end),
      value: row.budget_tg,
    }));
    this.#chart = barChart(plot, rows, query.step === "year" ? `${unit} per year` : `${unit} per period`);
  }

  #headline(total: Budget, unit: string): HTMLElement[] {
    const row = total.rows[0];
    if (!row) return [el("p", { class: "problem" }, "The period holds no stored step.")];
    const isCarbon = total.unit === "Tg C";
    const petagrams = isCarbon
      ? el("span", { class: "muted" }, `= ${valueText(row.budget_tg / TG_PER_PG)} Pg C`)
      : null;
    return [
      el(
        "p",
        { class: "reading" },
        el(
          "strong",
          { id: "budget-total", "data-value": String(row.budget_tg) },
          totalText(row.budget_tg),
        ),
        el("span", { class: "unit" }, unit),
        petagrams,
      ),
      el(
        "p",
        { class: "muted" },
        `${this.#form.titleOf(total.region)}, ${row.start.slice(0, 10)} to ${row.end.slice(0, 10)}. `,
        isCarbon ? "Negative: the sea takes carbon up." : null,
      ),
      el(
        "p",
        { class: "muted", id: "budget-coverage" },
        `Asked for ${areaText(total.region_area_m2)}, ${areaText(total.ocean_area_m2)} of it sea; sea with data ` +
          `${areaText(row.ocean_with_data_m2)}, ${numberText(row.coverage_percent, 1)} %. ${CELLS[total.cells]}`,
      ),
      el("p", { class: "muted", id: "budget-gaps" }, gapText(row, unit, total.gap_basis)),
      ...total.notes.map((note) => el("p", { class: "problem" }, note)),
    ];
  }
}

const CELLS: Record<Cells, string> = {
  whole: "Cells with data count whole, land on the coast too.",
  "ocean-share": "Cells with data count by their share of sea.",
};

/** What gaps would add, never added in silence. */
function gapText(row: BudgetRow, unit: string, basis: string): string {
  if (row.gap_tg === null) return "There are gaps, and nothing beside them to estimate them from.";
  if (row.gap_area_m2 === 0) return "No gaps in the sea that could be estimated.";
  return `Not in the budget: gaps of ${areaText(row.gap_area_m2)} would add ${totalText(row.gap_tg)} ${unit} (${basis}).`;
}

/** Four figures and at least one decimal: -1404.3, 27.03, 0.1234. */
function totalText(total: number): string {
  return digitsFor(total, 4) < 1 ? numberText(total, 1) : valueText(total);
}

/** Rows with the decimals of the largest one, at least two: -117.03, 0.1234. */
export function rowTexts(budgets: readonly number[]): string[] {
  const largest = Math.max(0, ...budgets.map(Math.abs));
  return budgets.map((budget) => (digitsFor(largest, 4) < 2 ? numberText(budget, 2) : alikeText(budget, largest)));
}

function table(answer: Budget, unit: string): HTMLElement {
  const head = el("tr", {}, ...["From", "To", unit, "Coverage"].map((title) => el("th", { scope: "col" }, title)));
  const budgets = rowTexts(answer.rows.map((row) => row.budget_tg));
  const rows = answer.rows.map((row, index) =>
    el(
      "tr",
      {},
      el("td", {}, row.start.slice(0, 10)),
      el("td", {}, row.end.slice(0, 10)),
      el("td", { class: "number" }, budgets[index]),
      el("td", { class: "number" }, `${numberText(row.coverage_percent, 1)} %`),
    ),
  );
  return el(
    "div",
    { class: "table-scroll" },
    el("table", { id: "budget-table" }, el("thead", {}, head), el("tbody", {}, ...rows)),
  );
}
