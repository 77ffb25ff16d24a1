//! What is marked on the globe, in plain numbers: whoever lays a picture over the globe draws it again on top.
import type { LonLat } from "./box";

export interface DrawnPoint extends LonLat {
  readonly colour: string;
  readonly edge: string;
  readonly edgePx: number;
  readonly sizePx: number;
}

export interface DrawnLine {
  readonly points: readonly LonLat[];
  readonly colour: string;
  readonly widthPx: number;
}

export interface Drawn {
  readonly lines: readonly DrawnLine[];
  readonly points: readonly DrawnPoint[];
}
