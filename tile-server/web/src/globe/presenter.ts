//! Decides which layer loads next: wishes from slider and playback in, one load at a time out, the newest wish first.
import { isSameLayer, layerKey, type LayerSpec } from "./layer";
import type { LayerStage, Prepared } from "./stage";

const FADE_MS = 220;
/**
 * A wish that no other one followed for so long is where the reader came to rest. A slow hand looks the same: whenever that
 * calls off a load, the next one is given twice the time, until a picture is shown.
 */
const REST_MS = 250;

interface Loading {
  readonly spec: LayerSpec;
  readonly abort: AbortController;
  /** Loads out of sight, for playback. */
  readonly isAhead: boolean;
}

export class Presenter {
  readonly #stage: LayerStage;
  #loading: Loading | undefined;
  #next: LayerSpec | undefined;
  #rest: ReturnType<typeof setTimeout> | undefined;
  #restMs = REST_MS;
  #waiting: ((isIdle: true) => void)[] = [];
  #isHeld = false;
  #kept: LayerSpec | undefined;

  constructor(stage: LayerStage) {
    this.#stage = stage;
  }

  /** While pictures lie over the globe nobody sees tiles: the newest wish is kept and loaded when that ends. */
  set isHeld(isHeld: boolean) {
    this.#isHeld = isHeld;
    const kept = this.#kept;
    if (isHeld || !kept) return;
    this.#kept = undefined;
    this.want(kept);
  }

  /**
   * Shows `spec` when it has loaded. While dragging, wishes come faster than pictures: the one under way is finished, so
   * that the globe keeps moving, and of those that came meanwhile only the last is loaded. Where the dragging rests, what is
   * still under way of an instant that was passed by is called off.
   */
  want(spec: LayerSpec): void {
    if (this.#isHeld) {
      this.#kept = spec;
      return;
    }
    clearTimeout(this.#rest);
    const loading = this.#loading;
    if (!loading || loading.isAhead || !isSameLayer(loading.spec, spec)) {
      this.#turnTo(spec);
      return;
    }
    const isUnderWay = layerKey(loading.spec) === layerKey(spec);
    this.#next = isUnderWay ? undefined : spec;
    if (!isUnderWay) this.#rest = setTimeout(() => this.#skip(), this.#restMs);
  }

  /** Loads `spec` for playback and hands it over unshown; null when something else was wished for meanwhile. */
  async preload(spec: LayerSpec): Promise<Prepared | null> {
    await this.idle();
    const abort = new AbortController();
    const loading = { spec, abort, isAhead: true };
    this.#loading = loading;
    const prepared = await this.#stage.prepare(spec, abort.signal);
    this.#ended(loading);
    return prepared;
  }

  reveal(prepared: Prepared, fadeMs: number): void {
    this.#stage.reveal(prepared, Math.min(FADE_MS, fadeMs));
  }

  discard(prepared: Prepared): void {
    this.#stage.discard(prepared);
  }

  /** Resolves when nothing loads; at once when nothing does. */
  idle(): Promise<true> {
    if (!this.#loading) return Promise.resolve(true);
    return new Promise((resolve) => this.#waiting.push(resolve));
  }

  /** Gives up what loads now, because the next wish shall start afresh even if it is the same. */
  abandon(): void {
    clearTimeout(this.#rest);
    this.#loading?.abort.abort();
    this.#loading = undefined;
    this.#next = undefined;
    this.#wake();
  }

  /** Forgets everything, for a change of product. */
  reset(): void {
    this.#kept = undefined;
    this.abandon();
    this.#stage.clear();
  }

  /** What loads now was passed by. */
  #skip(): void {
    if (!this.#next) return;
    this.#restMs *= 2;
    this.#turnTo(this.#next);
  }

  /** Whatever loads now is called off. */
  #turnTo(spec: LayerSpec): void {
    this.#loading?.abort.abort();
    this.#next = undefined;
    if (this.#stage.hasWhole(layerKey(spec))) return;
    void this.#load(spec);
  }

  async #load(spec: LayerSpec): Promise<void> {
    const abort = new AbortController();
    const loading = { spec, abort, isAhead: false };
    this.#loading = loading;
    const prepared = await this.#stage.prepare(spec, abort.signal);
    if (prepared) {
      this.#restMs = REST_MS;
      this.#stage.reveal(prepared, FADE_MS);
    }
    this.#ended(loading);
  }

  #ended(loading: Loading): void {
    // A load that was replaced has nothing to say any more: its successor speaks.
    if (this.#loading !== loading) return;
    this.#loading = undefined;
    const next = this.#next;
    this.#next = undefined;
    if (next && !this.#stage.hasWhole(layerKey(next))) {
      void this.#load(next);
      return;
    }
    this.#wake();
  }

  #wake(): void {
    const waiting = this.#waiting;
    this.#waiting = [];
    for (const resolve of waiting) resolve(true);
  }
}
