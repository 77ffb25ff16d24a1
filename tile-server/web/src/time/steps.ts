//! Pure time maths: product steps and instants in, positions on the time axis, quantised instants and readable labels out. All times are UTC.

/** One stored period of a product. Instants in milliseconds since 1970-01-01T00:00:00Z; `endMs` is exclusive. */
export interface Step {
  readonly startMs: number;
  readonly endMs: number;
  /** The instant that its values are those of. */
  readonly atMs: number;
}

/** Where in its period a value holds: a mean in the middle, a sum since the first start at the end. */
export type HoldsAt = "mid" | "end";

/** Playback and dragging ask for instants on this raster only, so that a second pass finds its tiles cached. */
export const PARTS_PER_STEP = 8;

/** Addresses tell instants apart that are so far apart. */
const SECOND_MS = 1000;
const DAY_MS = 86_400_000;
const DAY_S = DAY_MS / 1000;
const MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];

export function parseSteps(
  raw: readonly { start: string; end: string; mid: string }[],
  holdsAt: HoldsAt = "mid",
): Step[] {
  return raw
    .map((step) => ({ startMs: Date.parse(step.start), endMs: Date.parse(step.end), atMs: Date.parse(step[holdsAt]) }))
    .filter((step) => Number.isFinite(step.startMs) && Number.isFinite(step.atMs) && step.endMs > step.startMs)
    .sort((a, b) => a.startMs - b.startMs);
}

/** First start and last end; undefined for a product without steps. */
export function rangeOf(steps: readonly Step[]): { startMs: number; endMs: number } | undefined {
  const first = steps[0];
  const last = steps[steps.length - 1];
  return first && last ? { startMs: first.startMs, endMs: last.endMs } : undefined;
}

export function clampToRange(steps: readonly Step[], timeMs: number): number {
  const range = rangeOf(steps);
  return range ? Math.min(Math.max(timeMs, range.startMs), range.endMs) : timeMs;
}

/** Is there nothing of this instant? */
export function isOutside(steps: readonly Step[], timeMs: number): boolean {
  return clampToRange(steps, timeMs) !== timeMs;
}

/** What a reader is told who asked for an instant that there is nothing of; what is shown is `clampToRange`'s. */
export function outsideText(title: string, steps: readonly Step[], timeMs: number): string {
  const range = rangeOf(steps);
  if (!range) return "";
  const [from, to] = [range.startMs, range.endMs].map(formatInstant);
  const shown = formatInstant(clampToRange(steps, timeMs));
  return `“${title}” has nothing of ${formatInstant(timeMs)}: it covers ${from} to ${to}. Shown is ${shown}.`;
}

/**
 * Place of an instant on the axis of steps: 2.25 is a quarter into the third step.
 * An instant in a hole between two steps is at the start of the later one.
 */
export function positionOf(steps: readonly Step[], timeMs: number): number {
  let low = 0;
  let high = steps.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((steps[middle] as Step).endMs <= timeMs) low = middle + 1;
    else high = middle;
  }
  const step = steps[low];
  if (!step) return steps.length;
  return low + Math.max(0, timeMs - step.startMs) / (step.endMs - step.startMs);
}

/** Inverse of `positionOf`, clamped to the range. */
export function instantAt(steps: readonly Step[], position: number): number {
  const last = steps[steps.length - 1];
  if (!last) return Number.NaN;
  if (position >= steps.length) return last.endMs;
  const index = Math.max(0, Math.floor(position));
  const step = steps[index] as Step;
  return step.startMs + Math.max(0, position - index) * (step.endMs - step.startMs);
}

/** Nearest instant on the raster of `PARTS_PER_STEP` parts of a step, to the whole second. */
export function quantise(steps: readonly Step[], timeMs: number): number {
  const position = Math.round(positionOf(steps, timeMs) * PARTS_PER_STEP) / PARTS_PER_STEP;
  return wholeSecond(instantAt(steps, position));
}

/**
 * The next playback instant: `strideParts` parts of a step on, on multiples of the stride, and from the end to the start.
 * The last raster point (the end of the range) shows what the range's last middle shows, so the loop skips it, unless the
 * last value holds there.
 */
export function nextInstant(steps: readonly Step[], timeMs: number, strideParts: number): number {
  const parts = Math.round(positionOf(steps, timeMs) * PARTS_PER_STEP);
  const next = (Math.floor(parts / strideParts) + 1) * strideParts;
  const last = steps[steps.length - 1];
  const mostParts = steps.length * PARTS_PER_STEP - (last && last.atMs < last.endMs ? 1 : 0);
  return wholeSecond(instantAt(steps, next > mostParts ? 0 : next / PARTS_PER_STEP));
}

/** The instant of the stored step that play comes to next, or is at; beyond the last one, the last. */
export function stepAhead(steps: readonly Step[], timeMs: number): number {
  return (steps.find(({ atMs }) => atMs > timeMs - SECOND_MS) ?? steps.at(-1))?.atMs ?? timeMs;
}

/** The instant of the stored step next to an instant; undefined where there is none. */
export function stepBeside(steps: readonly Step[], timeMs: number, direction: 1 | -1): number | undefined {
  return direction > 0
    ? steps.find(({ atMs }) => atMs >= timeMs + SECOND_MS)?.atMs
    : steps.filter(({ atMs }) => atMs <= timeMs - SECOND_MS).at(-1)?.atMs;
}

/** Some steps or parts of one further on, and from the end to the start; undefined without steps. */
export function advanced(
  steps: readonly Step[],
  position: number,
  by: number,
): { position: number; timeMs: number } | undefined {
  if (steps.length === 0) return undefined;
  const next = position + by < steps.length ? position + by : 0;
  return { position: next, timeMs: wholeSecond(instantAt(steps, next)) };
}

/**
 * How many parts of a step playback advances at once, a power of two up to a whole step: a server that needs longer
 * for a frame than the speed allows gets fewer frames to draw, and the pace stays nearer to what was asked.
 */
export function strideFor(loadMs: number, frameMs: number): number {
  let stride = 1;
  while (stride < PARTS_PER_STEP && loadMs > stride * frameMs * 1.5) stride *= 2;
  return stride;
}

/** `2000-01-16T12:00:00Z`: seconds, no fraction, as the server writes them. */
export function toIso(timeMs: number): string {
  return `${new Date(timeMs).toISOString().slice(0, 19)}Z`;
}

export function formatInstant(timeMs: number): string {
  const time = new Date(timeMs).toISOString().slice(11, 16);
  return `${dayText(timeMs)}, ${time} UTC`;
}

/** `16 Jul 2000`. */
export function dayText(timeMs: number): string {
  const date = new Date(timeMs);
  return `${date.getUTCDate()} ${MONTHS[date.getUTCMonth()]} ${date.getUTCFullYear()}`;
}

/** Shortest label that tells all of a step: its year, month or day where it is no more than one, day and hour, or from which to which. */
export function stepLabel({ startMs, endMs }: Step): string {
  const [start, end, last] = [new Date(startMs), new Date(endMs), new Date(endMs - 1)];
  const days = (endMs - startMs) / DAY_MS;
  const year = (date: Date) => [String(date.getUTCFullYear())];
  const month = (date: Date) => [MONTHS[date.getUTCMonth()] ?? "", ...year(date)];
  const day = (date: Date) => [String(date.getUTCDate()), ...month(date)];
  if (days < 1) return `${day(start).join(" ")} ${start.toISOString().slice(11, 16)}`;
  if (days === 1) return day(start).join(" ");
  if (days > 300 && days <= 366) return year(start).join(" ");
  if (days >= 27 && days <= 31) return month(start).join(" ");
  if ([start, end].every(isNewYear)) return fromTo(year(start), year(last));
  if ([start, end].every(isNewMonth)) return fromTo(month(start), month(last));
  return fromTo(day(start), day(last));
}

/** Of how many steps one is labelled where room is for one in `least`: of months such that labels name the same months each year. */
export function labelledEvery(least: number, steps: readonly Step[]): number {
  const areMonths = steps.every(({ startMs, endMs }) => {
    const days = (endMs - startMs) / DAY_MS;
    return days >= 27 && days <= 31;
  });
  if (!areMonths || least <= 1) return Math.max(1, least);
  return [2, 3, 4, 6].find((months) => months >= least) ?? Math.ceil(least / 12) * 12;
}

/** `5–12 Jan 2002`: what both have at their ends is said once. */
function fromTo(from: readonly string[], to: readonly string[]): string {
  let own = from.length;
  while (own > 0 && from[own - 1] === to[own - 1]) own -= 1;
  return own === 0 ? to.join(" ") : `${from.slice(0, own).join(" ")}–${to.join(" ")}`;
}

function isNewMonth(date: Date): boolean {
  return date.getUTCDate() === 1 && date.getTime() % DAY_MS === 0;
}

function isNewYear(date: Date): boolean {
  return date.getUTCMonth() === 0 && isNewMonth(date);
}

/** Months by name and, where a year begins or at the first label, the year below; within days hours with the day below. */
export function timeNames(
  _plot: unknown,
  splits: readonly number[],
  _axis: number,
  _space: number,
  increment: number,
): string[] {
  let shownBelow = "";
  return splits.map((seconds) => {
    const date = new Date(seconds * 1000);
    const year = String(date.getUTCFullYear());
    if (increment >= 360 * DAY_S) return year;
    const isWithinDays = increment < DAY_S;
    const month = MONTHS[date.getUTCMonth()] ?? "";
    const day = increment < 27 * DAY_S ? `${date.getUTCDate()} ${month}` : month;
    const below = isWithinDays ? `${day} ${year}` : year;
    const name = isWithinDays ? date.toISOString().slice(11, 16) : day;
    const text = below === shownBelow ? name : `${name}\n${below}`;
    shownBelow = below;
    return text;
  });
}

function wholeSecond(timeMs: number): number {
  return Math.round(timeMs / SECOND_MS) * SECOND_MS;
}
