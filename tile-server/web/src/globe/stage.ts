//! Double-buffered product layers on the globe: a new instant loads out of sight, then fades in over the old one, so that nothing flashes.
import { ImageryLayer, type Scene } from "cesium";
import type { TileFailure } from "../api/again";
import { underOpacity } from "./fade";
import { layerKey, type LayerSpec } from "./layer";
import type { TileSources } from "./sources";
import { LayerTiles, type TileCounts } from "./tiles";

/** A layer that has loaded what the present view needs and waits for its turn. */
export interface Prepared {
  readonly spec: LayerSpec;
  readonly key: string;
  readonly layer: ImageryLayer;
  readonly tiles: LayerTiles;
  /** From the wish to its last tile, ms. */
  readonly tookMs: number;
}

/** Who is told of what goes wrong. */
export interface Trouble {
  /** The server does not say where a layer's tiles are. */
  readonly onRefused: (error: unknown) => void;
  /** A tile did not come. */
  readonly onFailed: (failure: TileFailure) => void;
}

/**
 * Quiet frames in a row before a layer counts as loaded: Cesium's queue is empty for a moment between a level of tiles and
 * the finer one that replaces it, and for longer before a new layer's first tile enters it.
 */
const QUIET_FRAMES = 2;
const QUIET_FRAMES_BEFORE_FIRST = 5;
/** While somebody keeps turning the globe new ground never stops loading; after this the layer is shown as it is. */
const RESTLESS_LIMIT_MS = 4_000;

export class LayerStage {
  /** Told of every layer that comes into sight. */
  onReveal: (spec: LayerSpec) => void = () => undefined;
  #shown: Prepared | undefined;
  #fade: { to: Prepared; startedMs: number; lengthMs: number } | undefined;
  #opacity: number;
  #isCovered = false;
  readonly #scene: Scene;
  readonly #sources: TileSources;
  readonly #counts: TileCounts;
  readonly #trouble: Trouble;

  constructor(scene: Scene, sources: TileSources, counts: TileCounts, opacity: number, trouble: Trouble) {
    this.#scene = scene;
    this.#sources = sources;
    this.#counts = counts;
    this.#opacity = opacity;
    this.#trouble = trouble;
    scene.preRender.addEventListener(() => this.#advanceFade());
  }

  get shown(): LayerSpec | undefined {
    return (this.#fade?.to ?? this.#shown)?.spec;
  }

  /** What the eye sees, or is about to see. */
  get shownKey(): string | undefined {
    return (this.#fade?.to ?? this.#shown)?.key;
  }

  /** How many tiles the layer in sight has, and how long they took. */
  get load(): { tiles: number; tookMs: number } | undefined {
    const shown = this.#fade?.to ?? this.#shown;
    return shown && { tiles: shown.tiles.requested, tookMs: shown.tookMs };
  }

  /** `key` is in sight, and no tile of it is missing. */
  hasWhole(key: string): boolean {
    const shown = this.#fade?.to ?? this.#shown;
    return shown?.key === key && shown.tiles.failed === 0;
  }

  set opacity(opacity: number) {
    this.#opacity = opacity;
    if (!this.#fade && this.#shown) this.#shown.layer.alpha = opacity;
    this.#scene.requestRender();
  }

  /** Something lies over the whole globe: for what nobody sees no tiles are asked for, wherever the camera goes. */
  set isCovered(isCovered: boolean) {
    if (this.#isCovered === isCovered) return;
    this.#isCovered = isCovered;
    if (this.#shown) this.#shown.layer.show = !isCovered;
    this.#scene.requestRender();
  }

  /** Loads a layer invisibly; null when `signal` ended it first or none of its tiles came, so that the old picture stays. */
  async prepare(spec: LayerSpec, signal: AbortSignal): Promise<Prepared | null> {
    const startedMs = performance.now();
    const source = await this.#sources.of(spec).catch((error: unknown) => {
      if (!signal.aborted) this.#trouble.onRefused(error);
    });
    if (!source || signal.aborted) return null;
    const tiles = new LayerTiles(spec, source, this.#counts, this.#trouble.onFailed);
    const layer = new ImageryLayer(tiles.provider, { alpha: 0 });
    this.#scene.imageryLayers.add(layer);
    const isLoaded = await this.#settled(tiles, signal);
    const prepared = { spec, key: layerKey(spec), layer, tiles, tookMs: performance.now() - startedMs };
    if (isLoaded && !tiles.isLost && !signal.aborted) return prepared;
    this.#remove(prepared);
    return null;
  }

  reveal(next: Prepared, lengthMs: number): void {
    this.#finishFade();
    this.#scene.imageryLayers.raiseToTop(next.layer);
    this.#fade = { to: next, startedMs: performance.now(), lengthMs: Math.max(1, lengthMs) };
    this.onReveal(next.spec);
    this.#scene.requestRender();
  }

  discard(prepared: Prepared): void {
    this.#remove(prepared);
  }

  /** Empties the stage: another product's picture must not stay under a new product's legend. */
  clear(): void {
    this.#finishFade();
    if (this.#shown) this.#remove(this.#shown);
    this.#shown = undefined;
    this.#scene.requestRender();
  }

  #settled(tiles: LayerTiles, signal: AbortSignal): Promise<boolean> {
    return new Promise((resolve) => {
      const startedMs = performance.now();
      let quietFrames = 0;
      const end = (isLoaded: boolean): void => {
        unlisten();
        signal.removeEventListener("abort", giveUp);
        resolve(isLoaded);
      };
      const giveUp = (): void => end(false);
      const unlisten = this.#scene.postRender.addEventListener(() => {
        const isRestless = performance.now() - startedMs > RESTLESS_LIMIT_MS;
        const isQuiet = tiles.pending === 0 && (this.#scene.globe.tilesLoaded || isRestless);
        quietFrames = isQuiet ? quietFrames + 1 : 0;
        if (quietFrames >= (tiles.requested > 0 ? QUIET_FRAMES : QUIET_FRAMES_BEFORE_FIRST)) end(true);
        else this.#scene.requestRender();
      });
      if (signal.aborted) end(false);
      signal.addEventListener("abort", giveUp, { once: true });
      this.#scene.requestRender();
    });
  }

  #advanceFade(): void {
    const fade = this.#fade;
    if (!fade) return;
    const part = (performance.now() - fade.startedMs) / fade.lengthMs;
    if (part >= 1) {
      this.#finishFade();
      return;
    }
    fade.to.layer.alpha = this.#opacity * Math.max(0, part);
    if (this.#shown) this.#shown.layer.alpha = underOpacity(this.#opacity, fade.to.layer.alpha);
    this.#scene.requestRender();
  }

  #finishFade(): void {
    const fade = this.#fade;
    if (!fade) return;
    this.#fade = undefined;
    fade.to.layer.alpha = this.#opacity;
    if (this.#shown) this.#remove(this.#shown);
    this.#shown = fade.to;
    this.#shown.layer.show = !this.#isCovered;
    this.#scene.requestRender();
  }

  #remove(prepared: Prepared): void {
    prepared.tiles.cancel();
    this.#scene.imageryLayers.remove(prepared.layer, true);
    this.#scene.requestRender();
  }
}
