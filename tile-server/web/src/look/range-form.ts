//! The range of values that the colours span: two typed numbers in, a range out; null is the product's own.
import { el } from "../page/dom";
import { unitText } from "../page/format";
import { parseRange } from "./address";
import type { Range } from "./look";

export class RangeForm {
  readonly element: HTMLElement;
  readonly #onChange: (range: Range | null) => void;
  readonly #low = number("range-low", "Lower end");
  readonly #high = number("range-high", "Upper end");
  readonly #title = el("span");
  readonly #problem = el("p", { class: "problem", id: "range-problem", role: "alert", hidden: true });
  #usual: Range = { low: 0, high: 1 };
  #isLog = false;
  #shown = "";

  constructor(onChange: (range: Range | null) => void) {
    this.#onChange = onChange;
    const usual = el("button", { type: "button", id: "range-default", onclick: () => this.#setUsual() }, "Default");
    this.element = el(
      "div",
      { class: "range-form", role: "group", "aria-label": "Range of values" },
      el("div", { class: "field" }, this.#title),
      el("div", { class: "row" }, this.#low, el("span", { class: "muted" }, "to"), this.#high, usual),
      this.#problem,
    );
    for (const input of [this.#low, this.#high]) input.addEventListener("change", () => this.#typed());
  }

  /** What somebody is about to type stays until the range itself is another one. `isLog`: it has to lie above 0. */
  show(range: Range | null, usual: Range, unit: string, isLog: boolean): void {
    this.#usual = usual;
    this.#isLog = isLog;
    this.#title.textContent = unit === "" ? "Range" : `Range, ${unitText(unit)}`;
    this.#fill(range ?? usual);
  }

  /** Back to the product's own numbers, whatever was typed. */
  clear(): void {
    this.#shown = "";
    this.#fill(this.#usual);
  }

  #setUsual(): void {
    this.#onChange(null);
    // No news to the store where only invalid numbers were typed.
    this.clear();
  }

  #typed(): void {
    const typed = parseRange(this.#low.value, this.#high.value);
    const isBelow = typeof typed !== "string" && this.#isLog && typed.low <= 0;
    const range = isBelow ? "A range on a logarithmic scale lies above 0." : typed;
    this.#say(typeof range === "string" ? range : "");
    if (typeof range === "string") return;
    const { low, high } = range;
    this.#shown = `${low}:${high}`;
    this.#onChange(low === this.#usual.low && high === this.#usual.high ? null : range);
  }

  #fill({ low, high }: Range): void {
    const shown = `${low}:${high}`;
    if (shown === this.#shown) return;
    this.#shown = shown;
    this.#low.value = String(low);
    this.#high.value = String(high);
    this.#say("");
  }

  #say(problem: string): void {
    this.#problem.textContent = problem;
    this.#problem.hidden = problem === "";
    for (const input of [this.#low, this.#high]) input.setAttribute("aria-invalid", String(problem !== ""));
  }
}

function number(id: string, label: string): HTMLInputElement {
  return el("input", { type: "number", id, step: "any", "aria-label": label, "aria-describedby": "range-problem" });
}
