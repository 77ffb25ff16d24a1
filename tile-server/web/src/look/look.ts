//! How a layer is to look: what a reader chose, what of it makes a difference, and what this server can draw.
import type { Mode } from "../api/types";

/** Values of the first and the last colour, in the legend's unit. */
export interface Range {
  readonly low: number;
  readonly high: number;
}

/** How values are spread over the colours. */
export type Scale = "linear" | "log";

export interface Look {
  /** Null is the product's own. */
  readonly palette: string | null;
  readonly reversed: boolean;
  /** Null is the product's own. */
  readonly range: Range | null;
  /** Null is the product's own. */
  readonly scale: Scale | null;
  /** Cells whose gap was filled are marked. */
  readonly uncertainty: boolean;
  /** An elevation product below the layer. */
  readonly relief: string | null;
  /** How much larger its heights are taken than they are. */
  readonly reliefExaggeration: number;
  /** Share of what lies deep below the sea surface that the sea hides. */
  readonly seaOpacity: number;
  readonly coastlines: boolean;
  /** Lines of equal values, at round ones. */
  readonly isolines: boolean;
  /** How far a kilogram of accumulated carbon a square metre lifts particles, m. */
  readonly heightMPerKgM2: number;
  /** The sun stands where it stood at the instant shown, not in the north-west. */
  readonly sunOfTime: boolean;
}

/** The server's own choices; a test over there holds these numbers against it. */
export const USUAL: Look = {
  palette: null,
  reversed: false,
  range: null,
  scale: null,
  uncertainty: false,
  relief: null,
  reliefExaggeration: 15,
  seaOpacity: 0,
  coastlines: false,
  isolines: false,
  heightMPerKgM2: 8_000_000,
  sunOfTime: false,
};

export const MOST_RELIEF_EXAGGERATION = 1000;
export const MOST_SEA_OPACITY = 0.99;
export const MOST_HEIGHT_M_PER_KG_M2 = 1_000_000_000;

/** Modes whose particles accumulated carbon lifts and sinks. */
const LIFTED: readonly Mode[] = ["points", "sprites", "volume"];

/** The same in the product's own colours: another product's values and unit are others. */
export function withoutColours(look: Look): Look {
  const { palette, reversed, range, scale } = USUAL;
  const hasNone =
    look.palette === palette && look.reversed === reversed && look.range === range && look.scale === scale;
  return hasNone ? look : { ...look, palette, reversed, range, scale };
}

/** The part of a look that makes a difference: what would change no pixel must not change the address. */
export function effective(look: Look, mode: Mode, isLifted: boolean): Look {
  const { uncertainty, seaOpacity, heightMPerKgM2, isolines } = USUAL;
  return {
    ...look,
    ...(canUncertainty(mode) ? {} : { uncertainty }),
    ...(hasIsolines(mode) ? {} : { isolines }),
    ...(hasSea(look, mode, isLifted) ? {} : { seaOpacity }),
    ...(hasHeight(mode, isLifted) ? {} : { heightMPerKgM2 }),
  };
}

/** The same without a palette or a relief that this server does not have. */
export function possible(look: Look, palettes: readonly string[], reliefs: readonly string[]): Look {
  const palette = look.palette !== null && palettes.includes(look.palette) ? look.palette : null;
  const relief = look.relief !== null && reliefs.includes(look.relief) ? look.relief : null;
  return palette === look.palette && relief === look.relief ? look : { ...look, palette, relief };
}

/** Trails of a flow do not show which cells were filled. */
export function canUncertainty(mode: Mode): boolean {
  return mode !== "flow";
}

/** Isolines are those of one quantity; a flow is drawn from two. */
export function hasIsolines(mode: Mode): boolean {
  return mode !== "flow";
}

/** The sea hides sunken particles and the floor of a relief; a thematic map alone has nothing below it. */
export function hasSea(look: Look, mode: Mode, isLifted: boolean): boolean {
  return look.relief !== null || hasHeight(mode, isLifted);
}

/** `isLifted`: carbon that accumulated lifts the product's particles. */
export function hasHeight(mode: Mode, isLifted: boolean): boolean {
  return isLifted && LIFTED.includes(mode);
}
