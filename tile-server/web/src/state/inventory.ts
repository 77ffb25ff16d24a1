//! What the server has at the moment, and which of it the state means: answers in; the chosen product, its steps and layers out.
import * as api from "../api/requests";
import type { Mode, Palette, Product } from "../api/types";
import type { LayerSpec } from "../globe/layer";
import { possible, type Look } from "../look/look";
import type { Step } from "../time/steps";
import { Catalogue } from "./catalogue";
import type { Store } from "./store";

export class Inventory {
  /** Replaced whole: who keeps an older one sees what there was. */
  catalogue = new Catalogue([]);
  palettes: readonly Palette[] = [];
  readonly #store: Store;
  /** Lists that were asked for, and the one of them that is here. */
  #asked = 0;
  #taken = 0;

  constructor(store: Store) {
    this.#store = store;
  }

  /** Products and palettes; nothing changes where one of them does not come. */
  async load(): Promise<void> {
    const turn = this.#turn();
    const [products, palettes] = await Promise.all([api.products(), api.palettes()]);
    this.#take(turn, products);
    this.palettes = palettes;
  }

  /** Products alone; the answer is what was known of them before. */
  async renew(): Promise<Catalogue> {
    const turn = this.#turn();
    const products = await api.products();
    const before = this.catalogue;
    this.#take(turn, products);
    return before;
  }

  #turn(): number {
    this.#asked += 1;
    return this.#asked;
  }

  /** A list that was asked for before the one that is here is older, however late it comes. */
  #take(turn: number, products: Product[]): void {
    if (turn < this.#taken) return;
    this.#taken = turn;
    this.catalogue = new Catalogue(products, this.catalogue);
  }

  /** The chosen product. */
  get product(): Product | undefined {
    return this.catalogue.find(this.#store.state.product);
  }

  get steps(): readonly Step[] {
    return this.catalogue.stepsOf(this.#store.state.product);
  }

  layerAt(timeMs: number): LayerSpec | undefined {
    return this.catalogue.layerAt(this.#store.state, timeMs);
  }

  lookIn(mode: Mode): Look {
    return this.catalogue.lookIn(mode, this.#store.state);
  }

  /** The picture at the instant shown, in any of the product's modes. */
  viewIn(mode: Mode): LayerSpec | undefined {
    return this.catalogue.layerAt({ ...this.#store.state, mode }, this.#store.state.timeMs);
  }

  /** An address may name a palette or a relief that is not here. */
  drawable(look: Look): Look {
    const palettes = this.palettes.map((palette) => palette.name);
    return possible(look, palettes, this.catalogue.reliefs.map((product) => product.product));
  }
}
