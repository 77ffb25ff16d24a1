//! The layer card: product, mode, opacity and what is loading, with room for the legend; changes go to the store only.
import type { Mode, Product } from "../api/types";
import { MODES } from "../api/words";
import type { TileCounts } from "../globe/tiles";
import { withoutColours } from "../look/look";
import { el, icon } from "../page/dom";
import { chemistry, titleTexts } from "../page/format";
import { PICTURE } from "../page/icons";
import type { Store } from "../state/store";
import { dayText } from "../time/steps";

const MODE_TITLES: Record<Mode, string> = { map: "Map", points: "Points", sprites: "Sprites", volume: "Volume", flow: "Flow" };
const MODE_HINTS: Record<Mode, string> = {
  map: "Thematic map",
  points: "Particles as points",
  sprites: "Particles as soft sprites",
  volume: "Particle volume, half-angle sliced: with shadows",
  flow: "Trails that drift with the current",
};

/** What is on its way: the date of the picture that playback waits for, or how many tiles of what was chosen. */
export function progressText(pending: number, waitsForMs: number | undefined): string {
  if (waitsForMs !== undefined) return `Loading ${dayText(waitsForMs)} …`;
  return pending > 0 ? `${pending} ${pending === 1 ? "tile" : "tiles"} on the way` : "";
}

export class Controls {
  /** Room for the legend. */
  readonly legend = el("div", { class: "legend-slot" });
  /** Room for the toggle of the live picture. */
  readonly live = el("div", { class: "live" });
  /** Room for the toggle of observations. */
  readonly observations = el("div");
  readonly #store: Store;
  readonly #product = el("select", { id: "product", "aria-label": "Product" });
  readonly #modes = el("div", { class: "segments", role: "radiogroup", "aria-label": "Mode" });
  readonly #source = el("p", { class: "source" });
  /** On a phone: opacity, the rendered view and the source, which wide windows always show. */
  readonly #more = el("button", { type: "button", class: "quiet more", id: "more", "aria-expanded": "false" }, "More");
  #pending = 0;
  #waitsForMs: number | undefined;
  readonly #progress = el("div", { class: "progress", id: "progress", role: "status" });

  constructor(container: HTMLElement, store: Store, onRenderView: () => void) {
    this.#store = store;
    const opacity = el("input", {
      type: "range",
      id: "opacity",
      min: "0",
      max: "1",
      step: "0.05",
      value: String(store.state.opacity),
    });
    opacity.addEventListener("input", () => store.set({ opacity: Number(opacity.value) }));
    this.#product.addEventListener("change", () =>
      store.set({ product: this.#product.value, look: withoutColours(store.state.look) }),
    );
    container.append(
      el(
        "header",
        { class: "brand" },
        el("img", { src: "./favicon.svg", alt: "", width: "26", height: "26" }),
        el("h1", {}, "Fluxglobe"),
        this.#progress,
        this.#more,
      ),
      el("label", { class: "field" }, el("span", { class: "visually-hidden" }, "Product"), this.#product),
      this.#modes,
      this.live,
      this.legend,
      this.observations,
      el("label", { class: "field row opacity" }, el("span", {}, "Opacity"), opacity),
      el(
        "button",
        { type: "button", class: "wide", id: "render-view", onclick: onRenderView },
        icon(PICTURE),
        "Render this view",
      ),
      this.#source,
    );
    this.#more.addEventListener("click", () => {
      const isWhole = container.classList.toggle("whole");
      this.#more.setAttribute("aria-expanded", String(isWhole));
      this.#more.textContent = isWhole ? "Less" : "More";
    });
    store.on(["mode"], () => this.#markMode());
    store.on(["opacity"], (state) => {
      opacity.value = String(state.opacity);
    });
  }

  setProducts(products: readonly Product[]): void {
    const titles = titleTexts(products);
    this.#product.replaceChildren(
      ...products.map(({ product }, index) => el("option", { value: product, title: product }, titles[index] ?? product)),
    );
  }

  setProduct(product: Product): void {
    this.#product.value = product.product;
    this.#product.title = chemistry(product.title);
    this.#source.textContent = chemistry(product.source);
    this.#source.title = product.source;
    // Few products are part of a vector: the others do not show a button that never works.
    const listed = MODES.filter((mode) => mode !== "flow" || product.modes.includes(mode));
    this.#modes.replaceChildren(...listed.map((mode) => this.#modeButton(mode, product.modes.includes(mode))));
    this.#markMode();
  }

  /** The line of what is on its way; empty when all is there. */
  watch(counts: TileCounts): void {
    counts.onChange(() => {
      this.#pending = counts.pending;
      this.#drawProgress();
    });
  }

  /** The instant whose picture playback waits for; undefined when it waits for none. */
  waitFor(timeMs: number | undefined): void {
    this.#waitsForMs = timeMs;
    this.#drawProgress();
  }

  #drawProgress(): void {
    const text = progressText(this.#pending, this.#waitsForMs);
    this.#progress.classList.toggle("busy", text !== "");
    if (this.#progress.textContent !== text) this.#progress.textContent = text;
  }

  #modeButton(mode: Mode, isOffered: boolean): HTMLElement {
    return el(
      "button",
      {
        type: "button",
        role: "radio",
        class: "segment",
        "data-mode": mode,
        title: MODE_HINTS[mode],
        disabled: !isOffered,
        onclick: () => this.#choose(mode),
        onkeydown: (event) => this.#turn(event as KeyboardEvent),
      },
      MODE_TITLES[mode],
    );
  }

  /** A flow is coloured by its speed: colours chosen for the one say nothing of the other. */
  #choose(mode: Mode): void {
    const { mode: before, look } = this.#store.state;
    const isOtherValue = (mode === "flow") !== (before === "flow");
    this.#store.set({ mode, look: isOtherValue ? withoutColours(look) : look });
  }

  /** Arrow keys move within the group, as radio buttons do. */
  #turn(event: KeyboardEvent): void {
    const by =
      event.key === "ArrowRight" || event.key === "ArrowDown"
        ? 1
        : event.key === "ArrowLeft" || event.key === "ArrowUp"
          ? -1
          : 0;
    if (by === 0) return;
    event.preventDefault();
    const offered = [...this.#modes.querySelectorAll<HTMLButtonElement>("button:not(:disabled)")];
    const at = offered.findIndex((button) => button.dataset["mode"] === this.#store.state.mode);
    const next = offered[(at + by + offered.length) % offered.length];
    next?.click();
    next?.focus();
  }

  #markMode(): void {
    for (const button of this.#modes.querySelectorAll<HTMLButtonElement>("button")) {
      const isChosen = button.dataset["mode"] === this.#store.state.mode;
      button.setAttribute("aria-checked", String(isChosen));
      button.tabIndex = isChosen ? 0 : -1;
    }
  }
}
