//! What the look panel can offer: catalogue, palettes and state in, the choices that make sense now out.
import type { Palette } from "../api/types";
import { titleText, unitText } from "../page/format";
import type { Catalogue } from "../state/catalogue";
import type { State } from "../state/store";
import { tickTexts } from "./legend";
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
  /** Why a logarithmic scale cannot be had; empty where it can. */
  logProblem: string;
  /** The layer is drawn on one now, chosen or by itself. */
  isLog: boolean;
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
  const range = { low: legend.low, high: legend.high };
  // Speeds of a flow have the same unit as its parts, and no other zero.
  const offset = mode === "flow" ? 0 : (catalogue.find(product)?.display_offset ?? 0);
  const choice = (palette: Palette): PaletteChoice => {
    const isUsual = JSON.stringify(palette.stops) === JSON.stringify(legend.stops);
    return { ...palette, isUsual, title: capitalised(palette.name) + (isUsual ? " (default)" : "") };
  };
  return {
    palettes: palettes.map(choice),
    range,
    unit: legend.unit,
    logProblem: logProblem(look.range ?? range, legend.unit, offset),
    isLog: (look.scale ?? legend.scale) === "log",
    reliefs: catalogue.reliefs.map((each) => ({ id: each.product, title: titleText(each) })),
    canUncertainty: canUncertainty(mode),
    hasIsolines: hasIsolines(mode),
    hasRelief: look.relief !== null,
    hasSea: hasSea(look, mode, isLifted),
    hasHeight: hasHeight(mode, isLifted),
  };
}

/** A logarithm has no place for 0 or less, and none for a zero that was agreed upon, as that of °C. */
function logProblem({ low }: Range, unit: string, offset: number): string {
  if (offset !== 0) return `No logarithmic scale: the zero of ${unitText(unit)} was agreed upon.`;
  if (low > 0) return "";
  return `A logarithmic scale needs a range above 0; this one begins at ${tickTexts([low]).join()}.`;
}

function capitalised(name: string): string {
  return name.slice(0, 1).toUpperCase() + name.slice(1);
}
