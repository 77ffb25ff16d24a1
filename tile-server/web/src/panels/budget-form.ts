//! The budget's question: a region by name, drawn or typed, a period, a step and an earth; a query out.
import type { BudgetQuery, Cells, Region } from "../api/types";
import { type Bounds, boxText, parseBox } from "../globe/box";
import { el, icon } from "../page/dom";
import { PENCIL } from "../page/icons";
import { type Step, stepLabel, toIso } from "../time/steps";

const BOX = "box";
const ALL_SEAS = "All seas";

export interface BudgetFormContext {
  /** Step, earth or period changed. */
  onChange: () => void;
  /** Another region was chosen: `global`, a name or `W,S,E,N`. */
  onRegion: (region: string) => void;
  drawBox: (onChange: (box: Bounds) => void, onEnd: (box: Bounds | undefined) => void) => void;
  markRegion: (box: Bounds | null) => void;
}

export class BudgetForm {
  readonly element: HTMLElement;
  readonly #context: BudgetFormContext;
  readonly #region = el("select", { id: "region", "aria-label": "Region" });
  readonly #box = el("input", {
    type: "text",
    id: "box",
    placeholder: "W,S,E,N",
    "aria-label": "Box: west, south, east, north in degrees",
    autocomplete: "off",
    spellcheck: "false",
  });
  readonly #draw = el("button", { type: "button", "aria-pressed": "false" }, icon(PENCIL), "Draw");
  readonly #boxRow = el(
    "form",
    { class: "row typed box-row", hidden: true },
    this.#box,
    el("button", { type: "submit" }, "Go"),
    this.#draw,
  );
  readonly #problem = el("p", { class: "problem", role: "alert", hidden: true });
  readonly #from = el("select", { id: "from", "aria-label": "First period" });
  readonly #to = el("select", { id: "to", "aria-label": "Last period" });
  readonly #step = choice("step", "Step", [
    ["month", "Monthly"],
    ["year", "Yearly"],
  ]);
  readonly #earth = choice("earth", "Earth", [
    ["wgs84", "WGS84"],
    ["sphere", "Sphere"],
  ]);
  readonly #cells = choice("cells", "Cells on the coast", [
    ["whole", "Whole"],
    ["ocean-share", "Share of sea"],
  ]);
  /** What only a sum is asked for with. */
  readonly #sumFields = [
    el("label", { class: "field" }, el("span", {}, "Step"), this.#step),
    el("label", { class: "field" }, el("span", {}, "Coast cells"), this.#cells),
  ] as const;
  #regions: readonly Region[] = [];
  #steps: readonly Step[] = [];
  #product = "";

  constructor(context: BudgetFormContext) {
    this.#context = context;
    this.element = el(
      "div",
      { class: "budget-form" },
      el("label", { class: "field" }, el("span", {}, "Region"), this.#region),
      this.#boxRow,
      this.#problem,
      el(
        "div",
        { class: "grid-2" },
        el("label", { class: "field" }, el("span", {}, "From"), this.#from),
        el("label", { class: "field" }, el("span", {}, "To"), this.#to),
        this.#sumFields[0],
        el("label", { class: "field" }, el("span", {}, "Earth"), this.#earth),
        this.#sumFields[1],
      ),
    );
    for (const select of [this.#from, this.#to, this.#step, this.#earth, this.#cells])
      select.addEventListener("change", () => context.onChange());
    this.#region.addEventListener("change", () => this.#regionChosen());
    this.#boxRow.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#boxTyped();
    });
    this.#draw.addEventListener("click", () => this.#startDrawing());
    this.setRegions([], "global");
  }

  setRegions(regions: readonly Region[], chosen: string): void {
    this.#regions = regions;
    const named = regions.filter((region) => region.name !== "global");
    this.#region.replaceChildren(
      el("option", { value: "global" }, this.titleOf("global")),
      ...named.map((region) => el("option", { value: region.name }, region.title)),
      el("option", { value: BOX }, "A box …"),
    );
    this.show(chosen);
  }

  /** Of the same product the chosen period stays, unless it went up to the newest step: then it still does. */
  setSteps(product: string, steps: readonly Step[]): void {
    const isSame = product === this.#product;
    const [from, to] = isSame ? [this.#chosen(this.#from), this.#chosen(this.#to)] : [];
    const isUpToNewest = to === this.#steps.at(-1);
    this.#product = product;
    this.#steps = steps;
    for (const select of [this.#from, this.#to])
      select.replaceChildren(...steps.map((step, index) => el("option", { value: String(index) }, stepLabel(step))));
    const last = steps.length - 1;
    // Where a step is gone, the next one within the period.
    const first = from ? steps.findIndex(({ startMs }) => startMs >= from.startMs) : 0;
    const end = to && !isUpToNewest ? steps.filter(({ endMs }) => endMs <= to.endMs).length - 1 : last;
    this.#from.value = String(first < 0 ? last : first);
    this.#to.value = String(Math.max(end, 0));
  }

  #chosen(select: HTMLSelectElement): Step | undefined {
    return this.#steps[Number(select.value)];
  }

  /** Sets the fields to a region without asking anything. */
  show(region: string): void {
    const box = parseBox(region);
    const isBox = typeof box !== "string";
    // A chosen but empty box stays chosen while the reader types.
    if (isBox || this.#region.value !== BOX || region !== "global") this.#region.value = isBox ? BOX : region;
    if (isBox) this.#box.value = boxText(box);
    this.#boxRow.hidden = this.#region.value !== BOX;
  }

  /** A mean is one of each step as it is, over all cells with data. */
  showSumFields(areShown: boolean): void {
    for (const field of this.#sumFields) field.hidden = !areShown;
  }

  boundsOf(region: string): Bounds | null {
    const box = parseBox(region);
    if (typeof box !== "string") return box;
    if (region === "global") return null;
    return this.#regions.find((known) => known.name === region)?.bounds_deg ?? null;
  }

  /** What a region is called: that in sight may be another one than the field says while a box is typed. */
  titleOf(region: string): string {
    const known = this.#regions.find(({ name }) => name === region);
    return known?.title ?? (region === "global" ? ALL_SEAS : region);
  }

  /** Undefined while the period is empty or there are no steps. */
  query(region: string): BudgetQuery | undefined {
    const [from, to] = [this.#chosen(this.#from), this.#chosen(this.#to)];
    if (!from || !to) return undefined;
    if (to.endMs <= from.startMs) {
      this.#say("The last period lies before the first.");
      return undefined;
    }
    this.#say("");
    return {
      region,
      from: toIso(from.startMs),
      to: toIso(to.endMs),
      step: this.#step.value as "month" | "year",
      earth: this.#earth.value as "wgs84" | "sphere",
      cells: this.#cells.value as Cells,
    };
  }

  #regionChosen(): void {
    this.#say("");
    this.#boxRow.hidden = this.#region.value !== BOX;
    if (this.#region.value !== BOX) this.#context.onRegion(this.#region.value);
    else if (this.#box.value !== "") this.#boxTyped();
    else this.#box.focus();
  }

  #boxTyped(): void {
    const box = parseBox(this.#box.value);
    this.#say(typeof box === "string" ? box : "");
    if (typeof box !== "string") this.#context.onRegion(boxText(box));
  }

  #startDrawing(): void {
    this.#draw.setAttribute("aria-pressed", "true");
    this.#say("");
    this.#context.drawBox(
      (box) => {
        this.#box.value = boxText(box);
        this.#context.markRegion(box);
      },
      (box) => {
        this.#draw.setAttribute("aria-pressed", "false");
        if (box) this.#context.onRegion(boxText(box));
      },
    );
  }

  #say(problem: string): void {
    this.#problem.textContent = problem;
    this.#problem.hidden = problem === "";
  }
}

function choice(id: string, label: string, options: readonly [value: string, title: string][]): HTMLSelectElement {
  return el("select", { id, "aria-label": label }, ...options.map(([value, title]) => el("option", { value }, title)));
}
