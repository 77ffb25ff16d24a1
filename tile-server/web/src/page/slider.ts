//! A labelled slider: a number in, the number it is left at out. While the thumb moves its own reading follows, and pictures where they can.
import { el } from "./dom";

export interface SliderOptions {
  id: string;
  label: string;
  max: number;
  step: number;
  text: (value: number) => string;
  /** Pictures follow the thumb; else one of every place that it passes would be drawn for nobody. */
  isFollowed: () => boolean;
  onChoose: (value: number) => void;
}

export class Slider {
  readonly element: HTMLElement;
  readonly #input: HTMLInputElement;
  readonly #output: HTMLOutputElement;
  readonly #text: (value: number) => string;

  constructor({ id, label, max, step, text, isFollowed, onChoose }: SliderOptions) {
    this.#text = text;
    this.#input = el("input", { type: "range", id, min: "0", max: String(max), step: String(step) });
    this.#output = el("output", { for: id });
    this.#input.addEventListener("input", () => {
      this.#read(Number(this.#input.value));
      if (isFollowed()) onChoose(Number(this.#input.value));
    });
    this.#input.addEventListener("change", () => onChoose(Number(this.#input.value)));
    const head = el("span", { class: "slider-head" }, el("span", {}, label), this.#output);
    this.element = el("label", { class: "field slider" }, head, this.#input);
  }

  /** A value beyond the slider's end is read out as it is. */
  show(value: number): void {
    this.#input.value = String(value);
    this.#read(value);
  }

  #read(value: number): void {
    const text = this.#text(value);
    this.#output.textContent = text;
    this.#input.setAttribute("aria-valuetext", text);
  }
}
