//! The look panel: how the layer is drawn in, changes of it to the store out.
import { el } from "../page/dom";
import { toggle } from "../page/toggle";
import type { Store } from "../state/store";
import { type Look, type Range, type Scale, USUAL } from "./look";
import type { LookOffer } from "./offer";
import { PaletteList } from "./palette-list";
import { RangeForm } from "./range-form";
import { SurroundingsForm } from "./surroundings-form";

export class LookPanel {
  readonly #store: Store;
  readonly #offer: () => LookOffer | undefined;
  readonly #palettes = new PaletteList((palette) => this.#change({ palette }));
  readonly #reversed = toggle("reversed", "Reversed", (reversed) => this.#change({ reversed }));
  readonly #range = new RangeForm((range) => this.#setRange(range));
  readonly #log = el("option", { value: "log" }, "Logarithmic");
  readonly #scaleHint = el("p", { class: "muted", id: "scale-hint", hidden: true });
  readonly #scale = el(
    "select",
    { id: "scale", "aria-describedby": "scale-hint" },
    el("option", { value: "" }, "As usual"),
    el("option", { value: "linear" }, "Linear"),
    this.#log,
  );
  readonly #uncertainty = toggle("uncertainty", "Mark cells that were filled", (uncertainty) => this.#change({ uncertainty }));
  readonly #surroundings: SurroundingsForm;

  /** `isFollowed`: pictures of any look come by themselves. */
  constructor(body: HTMLElement, store: Store, offer: () => LookOffer | undefined, isFollowed: () => boolean) {
    this.#store = store;
    this.#offer = offer;
    this.#surroundings = new SurroundingsForm((change) => this.#change(change), isFollowed);
    this.#scale.addEventListener("change", () => this.#change({ scale: (this.#scale.value || null) as Scale | null }));
    body.append(
      this.#palettes.element,
      el(
        "div",
        { class: "look-group" },
        this.#reversed.element,
        this.#range.element,
        el("label", { class: "field" }, el("span", {}, "Scale"), this.#scale),
        this.#scaleHint,
        this.#uncertainty.element,
      ),
      this.#surroundings.element,
      el("button", { type: "button", class: "wide", id: "look-reset", onclick: () => this.#reset() }, "Reset the look"),
    );
    store.on(["look", "mode", "product"], () => this.draw());
  }

  /** Again where the catalogue is another one. */
  draw(): void {
    const offer = this.#offer();
    if (!offer) return;
    const { look } = this.#store.state;
    this.#palettes.show(offer.palettes, look.palette, look.reversed);
    this.#reversed.show(look.reversed);
    this.#range.show(look.range, offer.range, offer.unit, offer.isLog);
    this.#log.disabled = offer.logProblem !== "";
    this.#scaleHint.textContent = offer.logProblem;
    this.#scaleHint.hidden = offer.logProblem === "";
    this.#scale.value = look.scale ?? "";
    this.#uncertainty.show(look.uncertainty);
    this.#uncertainty.element.hidden = !offer.canUncertainty;
    this.#surroundings.show(look, offer);
  }

  /** The product's own range may begin below 0: a logarithmic scale that was chosen for another one goes with it. */
  #setRange(range: Range | null): void {
    const isLost = range === null && this.#store.state.look.scale === "log" && !((this.#offer()?.range.low ?? 0) > 0);
    this.#change(isLost ? { range, scale: null } : { range });
  }

  #reset(): void {
    this.#store.set({ look: USUAL });
    this.#range.clear();
  }

  #change(change: Partial<Look>): void {
    this.#store.set({ look: { ...this.#store.state.look, ...change } });
  }
}
