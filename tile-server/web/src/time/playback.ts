//! Playback: loads the next instant out of sight, waits until it is due, shows it, and so on; a slow server stretches time, it never flashes.
//! Where pictures follow the state by themselves time runs with the screen, as fast as they come.
import { isSameLayer, type LayerSpec } from "../globe/layer";
import type { Presenter } from "../globe/presenter";
import type { Store } from "../state/store";
import { advanced, nextInstant, PARTS_PER_STEP, positionOf, quantise, stepAhead, type Step, strideFor } from "./steps";

/** A page that was out of sight goes on where it was, not where it would be. */
const MOST_FRAME_MS = 250;

/** Time does not run further ahead of the picture than this: where pictures come slowly so does time. */
const MOST_LAG_MS = 700;

/** What did not come is not asked for again at once: it would be asked for with every frame of the screen. */
const AGAIN_MS = 250;

/** A picture that takes longer than this stands still for the eye: it is told which instant is on its way. */
const LATE_MS = 400;

/** What shows the picture of the state by itself. */
export interface Follower {
  readonly isFollowing: boolean;
  readonly lagMs: number;
}

export class Playback {
  #run: { isOver: boolean } | undefined;
  readonly #store: Store;
  readonly #presenter: Presenter;
  readonly #steps: () => readonly Step[];
  readonly #specAt: (timeMs: number) => LayerSpec | undefined;
  readonly #follower: Follower;
  readonly #onLate: (timeMs: number | undefined) => void;

  /** `onLate` is told the instant whose picture is waited for, and of none when it is there. */
  constructor(
    store: Store,
    presenter: Presenter,
    steps: () => readonly Step[],
    specAt: (timeMs: number) => LayerSpec | undefined,
    follower: Follower,
    onLate: (timeMs: number | undefined) => void,
  ) {
    this.#store = store;
    this.#presenter = presenter;
    this.#steps = steps;
    this.#specAt = specAt;
    this.#follower = follower;
    this.#onLate = onLate;
    store.on(["playing"], (state) => {
      if (state.playing) this.#start();
      else this.#stop();
    });
  }

  #start(): void {
    this.#stop();
    const run = { isOver: false };
    this.#run = run;
    void this.#loop(run);
  }

  #stop(): void {
    if (!this.#run) return;
    this.#run.isOver = true;
    this.#run = undefined;
    this.#onLate(undefined);
    // It stops on what was measured, not between two of it, and never runs back.
    const { timeMs } = this.#store.state;
    if (Number.isFinite(timeMs)) this.#store.set({ timeMs: stepAhead(this.#steps(), timeMs) });
  }

  async #loop(run: { isOver: boolean }): Promise<void> {
    let loadMs = 0;
    let shownAtMs = performance.now();
    while (!run.isOver) {
      if (this.#follower.isFollowing) {
        this.#onLate(undefined);
        await this.#follow(run);
        continue;
      }
      const frameMs = 1000 / (this.#store.state.stepsPerSecond * PARTS_PER_STEP);
      const stride = strideFor(loadMs, frameMs);
      const fromMs = quantise(this.#steps(), this.#store.state.timeMs);
      const timeMs = nextInstant(this.#steps(), fromMs, stride);
      const spec = this.#specAt(timeMs);
      if (!spec) break;
      const startedMs = performance.now();
      // After a slow picture the next one is waited for from the start.
      const late = setTimeout(() => !run.isOver && this.#onLate(timeMs), loadMs < LATE_MS ? LATE_MS : 0);
      const prepared = await this.#presenter.preload(spec);
      clearTimeout(late);
      loadMs = performance.now() - startedMs;
      if (!run.isOver && loadMs < LATE_MS) this.#onLate(undefined);
      await until(Math.max(shownAtMs + stride * frameMs, prepared ? 0 : performance.now() + AGAIN_MS));
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

  /** Time runs as long as pictures follow; a hand on the slider sets from where. */
  async #follow(run: { isOver: boolean }): Promise<void> {
    let beforeMs = await frame();
    let position = positionOf(this.#steps(), this.#store.state.timeMs);
    while (!run.isOver && this.#follower.isFollowing) {
      const nowMs = await frame();
      const { timeMs, stepsPerSecond } = this.#store.state;
      const steps = this.#steps();
      // What was set is to the second, what is counted is not: only who moved the slider made a difference.
      const at = positionOf(steps, timeMs);
      if (Math.abs(at - position) > 1 / PARTS_PER_STEP) position = at;
      const isAhead = this.#follower.lagMs > MOST_LAG_MS;
      const next = advanced(steps, position, (Math.min(nowMs - beforeMs, MOST_FRAME_MS) / 1000) * stepsPerSecond);
      beforeMs = nowMs;
      if (run.isOver || next === undefined) return;
      if (isAhead) continue;
      position = next.position;
      this.#store.set({ timeMs: next.timeMs });
    }
  }
}

function frame(): Promise<number> {
  return new Promise((resolve) => requestAnimationFrame(resolve));
}

function until(dueMs: number): Promise<void> {
  const waitMs = dueMs - performance.now();
  return new Promise((resolve) => (waitMs > 0 ? setTimeout(resolve, waitMs) : requestAnimationFrame(() => resolve())));
}
