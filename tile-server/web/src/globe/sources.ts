//! Where the tiles of a layer are and how deep they go: the server is asked once for a version and a look, and answers with the edition that browsers may keep.
import { tileTemplate } from "../api/pictures";
import * as api from "../api/requests";
import type { TileJson } from "../api/types";
import { parameters } from "../look/address";
import { kindOf, type LayerSpec } from "./layer";

export interface TileSource {
  /** With `{z}`, `{x}` and `{y}`. */
  readonly template: string;
  readonly maxZoom: number;
}

/** Where the server does not say how deep its tiles go; Cesium stretches the deepest ones beyond. */
const DEFAULT_MAX_ZOOM = 6;
/** Heights and ranges are moved by hand: nobody comes back to more looks than these. */
const MOST_KNOWN = 200;

export class TileSources {
  readonly #known = new Map<string, Promise<TileJson>>();

  async of(spec: LayerSpec): Promise<TileSource> {
    const { edition, maxZoom } = partsOf(await this.#asked(spec));
    const version = { ...spec, ...(edition === undefined ? {} : { edition }) };
    return { template: tileTemplate(spec.product, spec.mode, spec.timeIso, version, parameters(spec.look)), maxZoom };
  }

  /** Something new is there, or another server: the same version may have another edition. */
  forget(): void {
    this.#known.clear();
  }

  #asked(spec: LayerSpec): Promise<TileJson> {
    const key = `${spec.product}:${spec.manifest}+${spec.revision}/${kindOf(spec)}`;
    const known = this.#known.get(key);
    if (known) return known;
    if (this.#known.size >= MOST_KNOWN) this.#known.clear();
    const asked = api.layerInfo(spec.product, spec.mode, spec.manifest, parameters(spec.look));
    this.#known.set(key, asked);
    // What failed is asked for again.
    asked.catch(() => this.#known.delete(key));
    return asked;
  }
}

/** The server's addresses begin at its root: of them the edition is taken, so that a page below a path prefix works, too. */
function partsOf({ pinned_tiles: [pinned] = [], maxzoom }: TileJson): { edition: string | undefined; maxZoom: number } {
  const edition = pinned === undefined ? undefined : (/[?&]edition=([0-9a-f]+)/.exec(pinned)?.[1] ?? undefined);
  return { edition, maxZoom: Number.isInteger(maxzoom) ? maxzoom : DEFAULT_MAX_ZOOM };
}
