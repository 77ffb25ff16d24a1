//! Decides which layer loads next: wishes from slider and playback in, one load at a time out, the newest wish first.
import { isSameLayer, layerKey, type LayerSpec } from "./layer";
import type { LayerStage, Prepared } from "./stage";

const FADE_MS = 220;

export class Presenter {
  readonly #stage: LayerStage;
  #loading: { spec: LayerSpec; abort: AbortController } | undefined;
  #next: LayerSpec | undefined;
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
   * that the globe keeps moving, and of those that came meanwhile only the last is loaded.
   */
  want(spec: LayerSpec): void {
    if (this.#isHeld) {
      this.#kept = spec;
      return;
    }
    if (this.#loading && isSameLayer(this.#loading.spec, spec)) {
      this.#next = layerKey(this.#loading.spec) === layerKey(spec) ? undefined : spec;
      return;
    }
    this.#loading?.abort.abort();
    this.#next = undefined;
    if (this.#stage.hasWhole(layerKey(spec))) return;
    void this.#load(spec);
  }

  /** Loads `spec` for playback and hands it over unshown; null when something else was wished for meanwhile. */
  async preload(spec: LayerSpec): Promise<Prepared | null> {
    await this.idle();
    const abort = new AbortController();
    const loading = { spec, abort };
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

  async #load(spec: LayerSpec): Promise<void> {
    const abort = new AbortController();
    const loading = { spec, abort };
    this.#loading = loading;
    const prepared = await this.#stage.prepare(spec, abort.signal);
    if (prepared) this.#stage.reveal(prepared, FADE_MS);
    this.#ended(loading);
  }

  #ended(loading: { spec: LayerSpec }): void {
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
