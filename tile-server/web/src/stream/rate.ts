//! How the stream does: shown pictures in, pictures a second and the time from a state to its picture on the screen out.

/** Pictures are counted over this long. */
const WINDOW_MS = 2_000;
/** The middle one of so many latencies is told: one slow picture is no slow stream. */
const LATENCIES = 9;

export class Rate {
  /** Pictures since the beginning. */
  shown = 0;
  #shownMs: number[] = [];
  #latenciesMs: number[] = [];

  add(askedMs: number, shownMs: number): void {
    this.shown += 1;
    this.#shownMs.push(shownMs);
    this.#latenciesMs = [...this.#latenciesMs, shownMs - askedMs].slice(-LATENCIES);
  }

  /** Pictures a second. */
  at(nowMs: number): number {
    this.#shownMs = this.#shownMs.filter((shownMs) => nowMs - shownMs < WINDOW_MS);
    return this.#shownMs.length / (WINDOW_MS / 1000);
  }

  /** NaN before the first picture. */
  get latencyMs(): number {
    return median(this.#latenciesMs);
  }
}

/** NaN of nothing. */
export function median(values: readonly number[]): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[sorted.length >> 1] ?? Number.NaN;
}
