//! The list of palettes, each with a strip of its colours: choices in, the name of the chosen one out; null is the product's own.
import { el } from "../page/dom";
import { gradientOf } from "./legend";
import type { PaletteChoice } from "./offer";

export class PaletteList {
  readonly element = el("div", { class: "palettes", role: "radiogroup", "aria-label": "Palette" });
  readonly #onChoose: (palette: string | null) => void;
  readonly #inputs = new Map<string, HTMLInputElement>();
  #listed = "";

  constructor(onChoose: (palette: string | null) => void) {
    this.#onChoose = onChoose;
  }

  show(choices: readonly PaletteChoice[], chosen: string | null, isReversed: boolean): void {
    // A list that is built anew loses the keyboard's place in it.
    const listed = JSON.stringify(choices);
    if (listed !== this.#listed) this.#build(choices);
    this.#listed = listed;
    for (const { name, isUsual } of choices) {
      const input = this.#inputs.get(name);
      if (input) input.checked = chosen === null ? isUsual : name === chosen;
    }
    this.element.classList.toggle("reversed", isReversed);
  }

  #build(choices: readonly PaletteChoice[]): void {
    this.#inputs.clear();
    this.element.replaceChildren(...choices.map((choice) => this.#row(choice)));
  }

  #row(choice: PaletteChoice): HTMLElement {
    const input = el("input", { type: "radio", name: "palette", value: choice.name, class: "visually-hidden" });
    input.addEventListener("change", () => this.#onChoose(choice.isUsual ? null : choice.name));
    this.#inputs.set(choice.name, input);
    const strip = el("span", { class: "palette-strip", "aria-hidden": "true" });
    strip.style.background = gradientOf(choice);
    return el("label", { class: "palette" }, input, strip, el("span", {}, choice.title));
  }
}
