//! What the look panel can offer: catalogue, palettes and state in, the choices that make sense now out.
import type { Palette } from "../api/types";
import { titleText } from "../page/format";
import type { Catalogue } from "../state/catalogue";
import type { State } from "../state/store";
import { canUncertainty, hasHeight, hasIsolines, hasSea, type Range } from "./look";

export interface PaletteChoice extends Palette {
  title: string;
  /** The one that the product has unless another is chosen. */
  isUsual: boolean;
}

export interface LookOffer {
  palettes: PaletteChoice[];
  /** The product's own, in the unit that people read. */
  range: Range;
  unit: string;
  reliefs: { id: string; title: string }[];
  canUncertainty: boolean;
  hasIsolines: boolean;
  hasRelief: boolean;
  hasSea: boolean;
  hasHeight: boolean;
}

/** Undefined until a product is known. */
export function offerOf(
  catalogue: Catalogue,
  palettes: readonly Palette[],
  { product, mode, look }: Readonly<State>,
): LookOffer | undefined {
  const legend = catalogue.usualLegend(product, mode);
  if (product === null || !legend) return undefined;
  const isLifted = catalogue.isLifted(product);
  const choice = (palette: Palette): PaletteChoice => {
    const isUsual = JSON.stringify(palette.stops) === JSON.stringify(legend.stops);
    return { ...palette, isUsual, title: capitalised(palette.name) + (isUsual ? " (default)" : "") };
  };
  return {
    palettes: palettes.map(choice),
    range: { low: legend.low, high: legend.high },
    unit: legend.unit,
    reliefs: catalogue.reliefs.map((each) => ({ id: each.product, title: titleText(each) })),
    canUncertainty: canUncertainty(mode),
    hasIsolines: hasIsolines(mode),
    hasRelief: look.relief !== null,
    hasSea: hasSea(look, mode, isLifted),
    hasHeight: hasHeight(mode, isLifted),
  };
}

function capitalised(name: string): string {
  return name.slice(0, 1).toUpperCase() + name.slice(1);
}
