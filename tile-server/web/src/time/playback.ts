//! Playback: loads the next instant out of sight, waits until it is due, shows it, and so on; a slow server stretches time, it never flashes.
import { isSameLayer, type LayerSpec } from "../globe/layer";
import type { Presenter } from "../globe/presenter";
import type { Store } from "../state/store";
import { nextInstant, PARTS_PER_STEP, quantise, type Step, strideFor } from "./steps";

export class Playback {
  #run: { isOver: boolean } | undefined;
  readonly #store: Store;
  readonly #presenter: Presenter;
  readonly #steps: () => readonly Step[];
  readonly #specAt: (timeMs: number) => LayerSpec | undefined;

  constructor(
    store: Store,
    presenter: Presenter,
    steps: () => readonly Step[],
    specAt: (timeMs: number) => LayerSpec | undefined,
  ) {
    this.#store = store;
    this.#presenter = presenter;
    this.#steps = steps;
    this.#specAt = specAt;
    store.on(["playing"], (state) => (state.playing ? this.#start() : this.#stop()));
  }

  #start(): void {
    this.#stop();
    const run = { isOver: false };
    this.#run = run;
    void this.#loop(run);
  }

  #stop(): void {
    if (this.#run) this.#run.isOver = true;
    this.#run = undefined;
  }

  async #loop(run: { isOver: boolean }): Promise<void> {
    let loadMs = 0;
    let shownAtMs = performance.now();
    while (!run.isOver) {
      const frameMs = 1000 / (this.#store.state.stepsPerSecond * PARTS_PER_STEP);
      const stride = strideFor(loadMs, frameMs);
      const fromMs = quantise(this.#steps(), this.#store.state.timeMs);
      const timeMs = nextInstant(this.#steps(), fromMs, stride);
      const spec = this.#specAt(timeMs);
      if (!spec) break;
      const startedMs = performance.now();
      const prepared = await this.#presenter.preload(spec);
      loadMs = performance.now() - startedMs;
      await until(shownAtMs + stride * frameMs);
      if (!prepared) continue;
      // A hand on the slider, a new product or a new look made this picture obsolete while it loaded.
      const now = this.#specAt(timeMs);
      const isStale = run.isOver || now === undefined || !isSameLayer(now, spec);
      const wasMoved = quantise(this.#steps(), this.#store.state.timeMs) !== fromMs;
      if (isStale || wasMoved) {
        this.#presenter.discard(prepared);
        continue;
      }
      shownAtMs = performance.now();
      this.#presenter.reveal(prepared, stride * frameMs * 0.9);
      this.#store.set({ timeMs });
    }
  }
}

function until(dueMs: number): Promise<void> {
  const waitMs = dueMs - performance.now();
  return new Promise((resolve) => (waitMs > 0 ? setTimeout(resolve, waitMs) : requestAnimationFrame(() => resolve())));
}
