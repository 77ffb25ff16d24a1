//! Pure reading of a point series: samples with gaps in, the value at an instant and the drawn extent out.

/** One period's value at a place, in the product's display unit; null is no data. */
export interface Sample {
  readonly midMs: number;
  readonly value: number | null;
}

/**
 * Value at an instant, linear between the two neighbouring period middles as the renderer draws it (V1 + (V2 - V1)(T - T1)/(T2 - T1)).
 * Before the first and after the last middle the end value holds. A gap on either side gives null, except exactly on a middle.
 */
export function valueAt(samples: readonly Sample[], timeMs: number): number | null {
  const first = samples[0];
  const last = samples[samples.length - 1];
  if (!first || !last) return null;
  if (timeMs <= first.midMs) return first.value;
  if (timeMs >= last.midMs) return last.value;
  const after = samples.findIndex((sample) => sample.midMs >= timeMs);
  const right = samples[after] as Sample;
  if (right.midMs === timeMs) return right.value;
  const left = samples[after - 1] as Sample;
  if (left.value === null || right.value === null) return null;
  return left.value + ((right.value - left.value) * (timeMs - left.midMs)) / (right.midMs - left.midMs);
}

export function hasData(samples: readonly Sample[]): boolean {
  return samples.some((sample) => sample.value !== null);
}
