//! The legend of what is in sight: a layer in, its colour bar out, or the colours of its codes. Colours that somebody chose are described by the server.
import { queryOf } from "../api/pictures";
import * as api from "../api/requests";
import type { Flag, Legend, Mode } from "../api/types";
import { colourParameters } from "./address";
import { codesView } from "./codes";
import { legendView } from "./legend";
import type { Look } from "./look";

/** What colours depend on. */
export interface Coloured {
  readonly product: string;
  /** The version: where a quantity has no range of its own, colours go by the values of all its steps. */
  readonly manifest: string;
  readonly mode: Mode;
  readonly look: Look;
}

/** Ranges are typed by hand: nobody comes back to more than these. */
const MOST_KNOWN = 50;

/** The legend of a version in its own colours, where it is known without asking. */
type Usual = (product: string, mode: Mode, manifest: string) => Legend | undefined;

/** What a product's values mean where they are codes; empty where they are none. */
type Codes = (product: string) => readonly Flag[];

export class LegendCard {
  readonly #slot: HTMLElement;
  readonly #usual: Usual;
  readonly #codes: Codes;
  readonly #onError: (key: string, error: unknown) => void;
  readonly #known = new Map<string, Promise<Legend>>();
  #wanted = "";
  #shown = "";

  constructor(slot: HTMLElement, usual: Usual, codes: Codes, onError: (key: string, error: unknown) => void) {
    this.#slot = slot;
    this.#usual = usual;
    this.#codes = codes;
    this.#onError = onError;
  }

  /** Asks for a legend that will be shown when its picture comes. */
  learn(layer: Coloured): void {
    // A failure is told when the legend is needed.
    this.#legendOf(layer).catch(() => undefined);
  }

  /** A picture must not stay under the legend of another one: this goes by what is in sight, not by what was chosen. */
  async show(layer: Coloured): Promise<void> {
    const wanted = keyOf(layer);
    this.#wanted = wanted;
    try {
      const legend = await this.#legendOf(layer);
      if (this.#wanted !== wanted || this.#shown === wanted) return;
      this.#shown = wanted;
      const codes = layer.mode === "flow" ? [] : this.#codes(layer.product);
      this.#slot.replaceChildren(codes.length > 0 ? codesView(legend, codes) : legendView(legend));
    } catch (error) {
      this.#onError("legend", error);
    }
  }

  async #legendOf(layer: Coloured): Promise<Legend> {
    const colours = colourParameters(layer.look);
    const usual = colours.length === 0 ? this.#usual(layer.product, layer.mode, layer.manifest) : undefined;
    if (usual) return usual;
    const key = keyOf(layer);
    const known = this.#known.get(key);
    if (known) return known;
    if (this.#known.size >= MOST_KNOWN) this.#known.clear();
    const asked = api.legend(layer.product, layer.mode, layer.manifest, colours);
    this.#known.set(key, asked);
    // What failed is asked for again.
    asked.catch(() => this.#known.delete(key));
    return asked;
  }
}

function keyOf({ product, manifest, mode, look }: Coloured): string {
  return `${product}:${manifest}/${mode === "flow" ? mode : ""}?${queryOf(colourParameters(look))}`;
}
