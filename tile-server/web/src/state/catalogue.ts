//! The products as the page uses them: steps parsed, and the layer that a state describes.
import type { Flag, Legend, Mode, News, Product, Quantity } from "../api/types";
import type { LayerSpec } from "../globe/layer";
import { effective, type Look } from "../look/look";
import { titleText } from "../page/format";
import { clampToRange, type HoldsAt, parseSteps, type Step, toIso } from "../time/steps";
import type { State } from "./store";

/** The quantity budgets are made of. */
export const FLUX = "carbon_flux";
/** The quantity that lifts and sinks the particles of what it was derived from. */
const ACCUMULATED = "accumulated_carbon";
/** The quantity reliefs are made of. */
const ELEVATION = "elevation";

/** Accumulated carbon grows from nothing at the first start, and what a step holds is there at its end. */
export function holdsAt(quantity: Quantity): HoldsAt {
  return quantity === ACCUMULATED ? "end" : "mid";
}

/** Units of angles, lower case: those of directions. */
const ANGLES = /^(°|(arc_)?degrees?|degrees?_?(true|t)|radians?|rad|deg)$/;

/** What values mean where they are codes, in the order of values. */
export function codesOf(quantity: Quantity): readonly Flag[] {
  return typeof quantity === "string" ? [] : (quantity.flags ?? []);
}

/** Is there something between two of its values? Not of codes, and not of directions; pictures have those of one step. */
export function isLinear(quantity: Quantity): boolean {
  if (typeof quantity === "string") return true;
  return codesOf(quantity).length === 0 && !ANGLES.test(quantity.unit.toLowerCase());
}

export class Catalogue {
  readonly products: readonly Product[];
  readonly #steps = new Map<string, readonly Step[]>();
  readonly #revisions: Map<string, number>;

  constructor(products: readonly Product[], before?: Catalogue) {
    this.products = products;
    this.#revisions = new Map(before ? before.#revisions : []);
    for (const product of products) this.#steps.set(product.product, parseSteps(product.steps, holdsAt(product.quantity)));
  }

  find(id: string | null): Product | undefined {
    return this.products.find((product) => product.product === id);
  }

  /** What a page without a wish shows: observed before synthetic, carbon fluxes before the rest, then what can be drawn in the most ways. */
  get first(): Product | undefined {
    return [...this.products].sort(
      (a, b) =>
        Number(a.synthetic) - Number(b.synthetic) ||
        Number(b.quantity === FLUX) - Number(a.quantity === FLUX) ||
        b.modes.length - a.modes.length,
    )[0];
  }

  /** Titles of products, each once; what was derived from another one of them goes without saying. */
  titlesOf(ids: readonly string[]): string[] {
    const goesWithoutSaying = (product: Product | undefined): boolean =>
      ids.some((id) => product?.derived_from?.startsWith(`${id}@`));
    const told = [...new Set(ids)].filter((id) => !goesWithoutSaying(this.find(id)));
    return told.map((id) => {
      const product = this.find(id);
      return product ? titleText(product) : id;
    });
  }

  /** What can lie below a layer. */
  get reliefs(): Product[] {
    return this.products.filter((product) => product.quantity === ELEVATION && product.steps.length > 0);
  }

  /** Carbon that accumulated lifts the product's particles. */
  isLifted(id: string): boolean {
    return this.#liftersOf(id).length > 0;
  }

  /**
   * What became new since an older list, told as the server tells it: versions, and those whose particles others lift now.
   * Which times they touch nobody knows, so it is all. Nothing where there was no list.
   */
  newsSince(before: Catalogue): News[] {
    if (before.products.length === 0) return [];
    const isNew = ({ product, manifest }: Product) => before.find(product)?.manifest !== manifest;
    const all = this.products.filter((product) => isNew(product) || this.#liftersOf(product.product).some(isNew));
    return all.map(({ product, manifest, start, end }) => ({
      product,
      manifest,
      touched: typeof start === "string" && typeof end === "string" ? [{ start, end }] : [],
    }));
  }

  #liftersOf(id: string): Product[] {
    return this.products.filter(
      (product) => product.quantity === ACCUMULATED && product.derived_from?.startsWith(`${id}@`),
    );
  }

  /** What the colours mean as long as nobody chose others; undefined of another version than the one that is here, whose range may be another. */
  usualLegend(id: string | null, mode: Mode, manifest?: string): Legend | undefined {
    const product = this.find(id);
    if (manifest !== undefined && product?.manifest !== manifest) return undefined;
    return (mode === "flow" ? product?.flow_legend : undefined) ?? product?.legend;
  }

  /** What a product's values mean where they are codes. */
  codesOf(id: string): readonly Flag[] {
    const product = this.find(id);
    return product ? codesOf(product.quantity) : [];
  }

  /** What is drawn of the chosen look in a mode. */
  lookIn(mode: Mode, { product, look }: Readonly<State>): Look {
    return effective(look, mode, product !== null && this.isLifted(product));
  }

  stepsOf(id: string | null): readonly Step[] {
    return (id !== null && this.#steps.get(id)) || [];
  }

  /** The same version looks different now: its pictures are asked for again. */
  revise(product: string): void {
    this.#revisions.set(product, (this.#revisions.get(product) ?? 0) + 1);
  }

  /** The layer to draw at `timeMs`; undefined until product and time are known. */
  layerAt(state: Readonly<State>, timeMs: number): LayerSpec | undefined {
    const product = this.find(state.product);
    if (!product || !Number.isFinite(timeMs)) return undefined;
    const clampedMs = clampToRange(this.stepsOf(product.product), timeMs);
    return {
      product: product.product,
      manifest: product.manifest,
      revision: this.#revisions.get(product.product) ?? 0,
      mode: state.mode,
      look: this.lookIn(state.mode, state),
      timeIso: toIso(clampedMs),
      bounds: product.bounds_deg,
    };
  }
}
