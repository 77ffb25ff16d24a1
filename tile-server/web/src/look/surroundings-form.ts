//! What surrounds the layer: coast lines, isolines, relief, sea, height of particles and sun; a look in, changes of it out.
import { el } from "../page/dom";
import { numberText } from "../page/format";
import { Slider } from "../page/slider";
import { toggle } from "../page/toggle";
import type { Look } from "./look";
import type { LookOffer } from "./offer";

/** Slopes beyond this are walls; the server takes more from an address. */
const SLIDER_RELIEF = 100;
/** Five times the usual height; particles beyond it leave the globe far behind. */
const SLIDER_HEIGHT_KM = 40_000;

export class SurroundingsForm {
  readonly element: HTMLElement;
  readonly #coastlines: ReturnType<typeof toggle>;
  readonly #isolines: ReturnType<typeof toggle>;
  readonly #relief = el("select", { id: "relief", "aria-describedby": "relief-hint" });
  readonly #hint = el("p", { class: "muted", id: "relief-hint" }, "No elevation product has been landed here yet.");
  readonly #exaggeration: Slider;
  readonly #sea: Slider;
  readonly #height: Slider;
  readonly #sun = el(
    "select",
    { id: "sun" },
    el("option", { value: "" }, "Fixed in the north-west"),
    el("option", { value: "time" }, "As at the time shown"),
  );

  #listed = "";

  constructor(onChange: (change: Partial<Look>) => void, isFollowed: () => boolean) {
    this.#coastlines = toggle("coastlines", "Coast lines", (coastlines) => onChange({ coastlines }));
    this.#isolines = toggle("isolines", "Isolines", (isolines) => onChange({ isolines }));
    this.#relief.addEventListener("change", () => onChange({ relief: this.#relief.value || null }));
    this.#exaggeration = new Slider({
      id: "relief-exaggeration",
      label: "Relief exaggeration",
      max: SLIDER_RELIEF,
      step: 1,
      text: (value) => `${numberText(value, 0)}×`,
      isFollowed,
      onChoose: (reliefExaggeration) => onChange({ reliefExaggeration }),
    });
    this.#sea = new Slider({
      id: "sea-opacity",
      label: "Sea opacity",
      max: 0.95,
      step: 0.05,
      text: (value) => `${numberText(value * 100, 0)} %`,
      isFollowed,
      onChoose: (seaOpacity) => onChange({ seaOpacity }),
    });
    this.#height = new Slider({
      id: "height-exaggeration",
      label: "Height of 1 kg C m⁻²",
      max: SLIDER_HEIGHT_KM,
      step: 500,
      text: (value) => `${numberText(value, 0)} km`,
      isFollowed,
      onChoose: (km) => onChange({ heightMPerKgM2: km * 1000 }),
    });
    this.#sun.addEventListener("change", () => onChange({ sunOfTime: this.#sun.value === "time" }));
    this.element = el(
      "div",
      { class: "look-group" },
      this.#coastlines.element,
      this.#isolines.element,
      el("label", { class: "field" }, el("span", {}, "Relief"), this.#relief),
      this.#hint,
      this.#exaggeration.element,
      this.#sea.element,
      this.#height.element,
      el("label", { class: "field" }, el("span", {}, "Sun"), this.#sun),
    );
  }

  show(look: Look, offer: LookOffer): void {
    this.#coastlines.show(look.coastlines);
    this.#isolines.element.hidden = !offer.hasIsolines;
    this.#isolines.show(look.isolines);
    this.#list(offer.reliefs);
    this.#relief.value = look.relief ?? "";
    this.#relief.disabled = offer.reliefs.length === 0;
    this.#hint.hidden = offer.reliefs.length > 0;
    this.#exaggeration.element.hidden = !offer.hasRelief;
    this.#exaggeration.show(look.reliefExaggeration);
    this.#sea.element.hidden = !offer.hasSea;
    this.#sea.show(look.seaOpacity);
    this.#height.element.hidden = !offer.hasHeight;
    this.#height.show(look.heightMPerKgM2 / 1000);
    this.#sun.value = look.sunOfTime ? "time" : "";
  }

  /** Options that are replaced close a list that is open. */
  #list(reliefs: LookOffer["reliefs"]): void {
    const listed = JSON.stringify(reliefs);
    if (listed === this.#listed) return;
    this.#listed = listed;
    const options = reliefs.map(({ id, title }) => el("option", { value: id }, title));
    this.#relief.replaceChildren(el("option", { value: "" }, "None"), ...options);
  }
}
