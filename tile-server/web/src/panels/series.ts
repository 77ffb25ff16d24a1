//! Pure reading of a point series: an answer in; samples with gaps, the value at an instant and what a sum holds out.
import type { CellCounts, PointSeries } from "../api/types";
import { numberText } from "../page/format";
import type { HoldsAt } from "../time/steps";

/** A value at a place, in the product's display unit, and the instant that it is that of; null is no data. */
export interface Sample {
  readonly atMs: number;
  readonly value: number | null;
  /** What a sum holds, where it is one and that is known. */
  readonly contributed?: CellCounts | undefined;
}

/** Values at their middles; sums at their ends, after the nothing that they begin with. */
export function samplesOf(series: PointSeries["series"], holdsAt: HoldsAt): Sample[] {
  const samples = series.map((row) => ({
    atMs: Date.parse(row[holdsAt]),
    value: row.value,
    contributed: row.contributed,
  }));
  const first = series[0];
  if (holdsAt === "mid" || !first) return samples;
  return [{ atMs: Date.parse(first.start), value: first.value === null ? null : 0 }, ...samples];
}

/** The same of values that have nothing between two of them: each holds from its start to its end. */
export function heldSamplesOf(series: PointSeries["series"]): Sample[] {
  return series.flatMap((row) => {
    const { value } = row;
    return [
      { atMs: Date.parse(row.start), value },
      { atMs: Date.parse(row.end) - 1, value },
    ];
  });
}

/** The one of two neighbouring samples that is nearer to an instant, where there is nothing between them; null is no data. */
export function heldAt(samples: readonly Sample[], timeMs: number): number | null {
  const after = samples.findIndex((sample) => sample.atMs >= timeMs);
  const right = after < 0 ? samples.at(-1) : samples[after];
  const left = samples[after - 1] ?? right;
  if (!left || !right) return null;
  return right.atMs - timeMs <= timeMs - left.atMs ? right.value : left.value;
}

/**
 * Value at an instant, linear between the two neighbouring samples as the renderer draws it (V1 + (V2 - V1)(T - T1)/(T2 - T1)).
 * Before the first and after the last sample the end value holds. A gap on either side gives null, except exactly on a sample.
 */
export function valueAt(samples: readonly Sample[], timeMs: number): number | null {
  const first = samples[0];
  const last = samples[samples.length - 1];
  if (!first || !last) return null;
  if (timeMs <= first.atMs) return first.value;
  if (timeMs >= last.atMs) return last.value;
  const after = samples.findIndex((sample) => sample.atMs >= timeMs);
  const right = samples[after] as Sample;
  if (right.atMs === timeMs) return right.value;
  const left = samples[after - 1] as Sample;
  if (left.value === null || right.value === null) return null;
  return left.value + ((right.value - left.value) * (timeMs - left.atMs)) / (right.atMs - left.atMs);
}

/** What is missing of the sum that is in the making at an instant; nothing of one that is complete, of no sum, and where nobody knows. */
export function missingText(samples: readonly Sample[], timeMs: number): string {
  const sample = samples.find(({ atMs }) => atMs >= timeMs) ?? samples.at(-1);
  const counts = sample?.contributed;
  if (!counts || sample.value === null || counts.time_percent >= 100) return "";
  const share = numberText(counts.time_percent, 1);
  return `Not complete: ${counts.steps} of ${counts.of_steps} periods had data, ${share} % of the time.`;
}

export function hasData(samples: readonly Sample[]): boolean {
  return samples.some((sample) => sample.value !== null);
}
