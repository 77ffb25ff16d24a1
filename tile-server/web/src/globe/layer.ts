//! What a layer on the globe shows: everything that decides its pictures, and what tells two of them apart.
import { queryOf, type Version } from "../api/pictures";
import type { Mode } from "../api/types";
import { parameters } from "../look/address";
import type { Look } from "../look/look";
import type { Bounds } from "./box";

/** Everything that decides what a layer looks like; two equal keys are the same pictures. */
export interface LayerSpec extends Version {
  readonly product: string;
  readonly mode: Mode;
  /** Of what was chosen that which makes a difference in this mode. */
  readonly look: Look;
  readonly timeIso: string;
  readonly bounds: Bounds;
}

export function layerKey(spec: LayerSpec): string {
  const revision = spec.revision > 0 ? `+${spec.revision}` : "";
  return `${spec.product}:${spec.manifest}${revision}/${kindOf(spec)}@${spec.timeIso}`;
}

/** Two instants of one layer: the same product in the same mode and look. */
export function isSameLayer(a: LayerSpec, b: LayerSpec): boolean {
  return a.product === b.product && kindOf(a) === kindOf(b);
}

/** Mode and look. */
export function kindOf({ mode, look }: LayerSpec): string {
  const query = queryOf(parameters(look));
  return query === "" ? mode : `${mode}?${query}`;
}
