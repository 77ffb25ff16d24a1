//! What a film shows when: a period, a length and a rate in, the instant of every frame out, or what is wrong with them.

export interface FilmPlan {
  readonly startMs: number;
  readonly endMs: number;
  readonly seconds: number;
  readonly framesPerSecond: number;
}

/** What there is pictures of; `endMs` is exclusive. */
export interface Coverage {
  readonly startMs: number;
  readonly endMs: number;
}

/** Each is drawn by the server, one after the other: at two a second this is half an hour. */
export const MOST_FRAMES = 3600;

export function frameCount({ seconds, framesPerSecond }: FilmPlan): number {
  return Math.round(seconds * framesPerSecond);
}

/** Undefined if nothing is wrong. */
export function problemOf(plan: FilmPlan, coverage: Coverage): string | undefined {
  if (![plan.startMs, plan.endMs].every(Number.isFinite)) return "The film needs a first and a last day.";
  if (plan.endMs <= plan.startMs) return "The last day must come after the first.";
  const [from, to] = daysOf(plan);
  const [first, last] = daysOf(coverage);
  if (from < first || to > last)
    return `There is nothing of all of ${from} to ${to}: the product covers ${first} to ${last}. A film would stand still on the other days.`;
  if (!(plan.framesPerSecond >= 1 && plan.framesPerSecond <= 60)) return "Frames a second are 1 to 60.";
  const frames = frameCount(plan);
  if (!(frames >= 2 && frames <= MOST_FRAMES)) return `A film has 2 to ${MOST_FRAMES} frames; this one would have ${frames || 0}.`;
  return undefined;
}

/** The first and the last day of a period, as they are typed. */
export function daysOf({ startMs, endMs }: Coverage): [first: string, last: string] {
  return [dayOf(startMs), dayOf(endMs - 1)];
}

function dayOf(timeMs: number): string {
  return new Date(timeMs).toISOString().slice(0, 10);
}

/** The first frame shows the start and the last one the end. */
export function instants(plan: FilmPlan): number[] {
  const last = frameCount(plan) - 1;
  const spanMs = plan.endMs - plan.startMs;
  return Array.from({ length: last + 1 }, (_, i) => Math.round(plan.startMs + (spanMs * i) / last));
}
