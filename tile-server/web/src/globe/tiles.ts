//! One product layer's tiles: an imagery provider per instant, and counts of what is on its way for the progress line and the tests.
import {
  Rectangle,
  type Request,
  RequestErrorEvent,
  RequestState,
  Resource,
  TileProviderError,
  UrlTemplateImageryProvider,
  WebMercatorTilingScheme,
} from "cesium";
import { MOST_TIMES, pauseMs, type TileFailure, waited } from "../api/again";
import { reasonOf } from "../api/client";
import { type Bounds, isWhole } from "./box";
import type { LayerSpec } from "./layer";
import type { TileSource } from "./sources";

/** Totals over all layers since the page was loaded. */
export class TileCounts {
  loaded = 0;
  pending = 0;
  failed = 0;
  readonly #listeners: (() => void)[] = [];

  onChange(listener: () => void): void {
    this.#listeners.push(listener);
  }

  add(change: { loaded?: number; pending?: number; failed?: number }): void {
    this.loaded += change.loaded ?? 0;
    this.pending += change.pending ?? 0;
    this.failed += change.failed ?? 0;
    for (const listener of this.#listeners) listener();
  }
}

const TILE_PX = 256;
/** Web Mercator ends here; the two caps beyond have no tiles. */
const MERCATOR_LAT_DEG = 85.05112878;

export class LayerTiles {
  readonly provider: UrlTemplateImageryProvider;
  /** Requests of this layer that have not ended yet. */
  pending = 0;
  requested = 0;
  failed = 0;
  readonly #requests = new Set<Request>();
  /** How often a tile was asked for again. */
  readonly #times = new WeakMap<Resource, number>();
  readonly #gone = new AbortController();

  constructor(
    { bounds }: LayerSpec,
    { template, maxZoom }: TileSource,
    counts: TileCounts,
    onFailure: (failure: TileFailure) => void,
  ) {
    const provider = new UrlTemplateImageryProvider({
      url: new Resource({
        url: template,
        retryAttempts: MOST_TIMES,
        retryCallback: (tile, error) => this.#isAskedAgain(tile, error),
      }),
      tilingScheme: new WebMercatorTilingScheme(),
      tileWidth: TILE_PX,
      tileHeight: TILE_PX,
      maximumLevel: maxZoom,
      rectangle: rectangleOf(bounds),
      enablePickFeatures: false,
    });
    this.provider = provider;
    this.#countRequests(provider, counts);
    provider.errorEvent.addEventListener((error: TileProviderError) => {
      if (this.#gone.signal.aborted) return;
      const cause: unknown = error.error;
      const url = template
        .replace("{z}", String(error.level))
        .replace("{x}", String(error.x))
        .replace("{y}", String(error.y));
      onFailure({ status: cause instanceof RequestErrorEvent ? cause.statusCode : undefined, url, reason: saidBy(cause) });
    });
  }

  /** Nothing of this layer came: there is no picture to show, only one to lose. */
  get isLost(): boolean {
    return this.requested > 0 && this.failed === this.requested;
  }

  /** Nobody looks at this layer any more: Cesium itself would wait for what it asked for. */
  cancel(): void {
    this.#gone.abort();
    // The library's declarations leave this one out.
    for (const request of this.#requests) (request as Request & { cancel(): void }).cancel();
  }

  /** Until the time that a busy server names a tile is on its way like any other; then Cesium asks for it again. */
  async #isAskedAgain(tile: Resource | undefined, error: unknown): Promise<boolean> {
    const times = tile && this.#times.get(tile);
    const pause = pauseMs(retryAfterOf(error), times ?? 0);
    if (!tile || pause === undefined) return false;
    this.#times.set(tile, (times ?? 0) + 1);
    // Put off for want of a connection, it would be taken for one that failed.
    (tile.request as { throttleByServer: boolean }).throttleByServer = false;
    return waited(pause, this.#gone.signal);
  }

  /** The provider's own method is kept and only watched: Cesium decides what to ask for and when. */
  #countRequests(provider: UrlTemplateImageryProvider, counts: TileCounts): void {
    const request = provider.requestImage.bind(provider);
    provider.requestImage = (x, y, level, req) => {
      const promise = request(x, y, level, req);
      if (!promise) return promise;
      if (req) this.#requests.add(req);
      this.pending += 1;
      this.requested += 1;
      counts.add({ pending: 1 });
      const end = (outcome: { loaded?: number; failed?: number }): void => {
        if (req) this.#requests.delete(req);
        this.pending -= 1;
        this.failed += outcome.failed ?? 0;
        counts.add({ pending: -1, ...outcome });
      };
      promise.then(
        () => end({ loaded: 1 }),
        () => {
          // Cesium calls requests off when nearer ground needs the line, and asks again later: that is no failure.
          const isCalledOff = req?.state === RequestState.CANCELLED || this.#gone.signal.aborted;
          if (isCalledOff) this.requested -= 1;
          end(isCalledOff ? {} : { failed: 1 });
        },
      );
      return promise;
    };
  }
}

function retryAfterOf(error: unknown): string | undefined {
  if (!(error instanceof RequestErrorEvent)) return undefined;
  // Proxies that speak HTTP/1.1 write names as they like.
  const headers = Object.entries((error.responseHeaders ?? {}) as Record<string, string>);
  return headers.find(([name]) => name.toLowerCase() === "retry-after")?.[1];
}

function saidBy(error: unknown): Promise<string> | undefined {
  if (!(error instanceof RequestErrorEvent) || retryAfterOf(error) === undefined) return undefined;
  const body = error.response instanceof Blob ? error.response : null;
  return reasonOf(new Response(body, { status: error.statusCode ?? 503 }));
}

function rectangleOf(bounds: Bounds): Rectangle {
  const [west, south, east, north] = bounds;
  const low = Math.max(south, -MERCATOR_LAT_DEG);
  const high = Math.min(north, MERCATOR_LAT_DEG);
  const crossesDateLine = west < -180 || east > 180 || west > east;
  // A tile is the same whichever way it is reached; a rectangle across the date line is not worth the special cases.
  return isWhole(bounds) || crossesDateLine
    ? Rectangle.fromDegrees(-180, low, 180, high)
    : Rectangle.fromDegrees(west, low, east, high);
}
