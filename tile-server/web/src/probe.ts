//! `window.fluxglobe`: what a test or a curious reader may watch, never change.
import type { Platform } from "./api/types";
import type { Globe } from "./globe/globe";
import type { TileCounts } from "./globe/tiles";
import type { Live } from "./stream/live";
import { onGround, poseOf, seen } from "./stream/pose";
import type { State, Store } from "./state/store";

export interface Probe {
  /** The catalogue is there and the first layer is drawn. */
  readonly ready: boolean;
  readonly tilesLoaded: number;
  readonly tilesPending: number;
  readonly tilesFailed: number;
  /** `product:manifest/mode?look@instant` of the layer in sight; no question mark in the usual look. */
  readonly shown: string | undefined;
  /** Names of the platforms on the globe, `dataset/platform`, with their place. */
  readonly platforms: readonly { id: string; lon: number; lat: number }[];
  /** The live picture in sight: which address it shows, whether the full one; undefined where tiles are. */
  readonly picture: { view: string; kind: string; width: number; height: number; tookMs: number } | undefined;
  /** Live pictures that were shown since the page was loaded, those of the last seconds a second, and how late they are. */
  readonly pictures: { shown: number; perSecond: number; latencyMs: number };
  readonly state: Readonly<State>;
  /** Canvas point of a place in CSS pixels; undefined when it is on the far side. */
  project(lon: number, lat: number): { x: number; y: number } | undefined;
  /** The same as the server's renderer reckons it, wherever the place is. */
  projectAsDrawn(lon: number, lat: number, heightM?: number): { x: number; y: number } | undefined;
}

declare global {
  interface Window {
    fluxglobe: Probe;
  }
}

export function installProbe(
  store: Store,
  counts: TileCounts,
  globe: Globe,
  shown: () => string | undefined,
  platforms: () => readonly Platform[],
  live: Live,
): { setReady: () => void } {
  let isReady = false;
  window.fluxglobe = {
    get ready() {
      return isReady;
    },
    get tilesLoaded() {
      return counts.loaded;
    },
    get tilesPending() {
      return counts.pending;
    },
    get tilesFailed() {
      return counts.failed;
    },
    get shown() {
      return shown();
    },
    get platforms() {
      return platforms().map(({ id, properties }) => ({ id, lon: properties.lon_deg, lat: properties.lat_deg }));
    },
    get picture() {
      const { picture } = live;
      if (!picture) return undefined;
      const { view, kind, width, height, tookMs } = picture;
      return { view, kind, width, height, tookMs };
    },
    get pictures() {
      const { rate } = live;
      return { shown: rate.shown, perSecond: rate.at(performance.now()), latencyMs: rate.latencyMs };
    },
    get state() {
      return store.state;
    },
    project: (lon, lat) => globe.project({ lon, lat }),
    projectAsDrawn: (lon, lat, heightM = 0) => {
      const { clientWidth, clientHeight } = globe.canvas;
      return seen(poseOf(globe.view, clientWidth, clientHeight), onGround(lon, lat, heightM));
    },
  };
  return {
    setReady: () => {
      isReady = true;
    },
  };
}
