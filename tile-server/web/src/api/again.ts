//! When a server that has too much to do is asked again: what its refusal says in, a pause or none out.
import { ApiError } from "./client";

/** A tile that did not come. */
export interface TileFailure {
  /** Undefined where nobody answered. */
  readonly status: number | undefined;
  readonly url: string;
  /** The server's words, where it wants to be left alone for a while and must not be asked for them. */
  readonly reason: Promise<string> | undefined;
}

/** Times that one picture is asked for again. */
export const MOST_TIMES = 5;
/** Nobody looks longer at a globe that waits; a server that wants to be left alone for longer is taken at its word. */
const LONGEST_MS = 30_000;
/** "At once" is no time for a server that has just sent somebody away. */
const LEAST_MS = 250;
/** Share of a pause that it may be longer by chance: who was sent away with others does not come back with them. */
const JITTER = 0.5;

/**
 * How long to wait before a picture is asked for again, ms: never less than the server says, and twice as long with every
 * time that was in vain. Undefined where it does not say when to come, or later than anybody waits for.
 * @param retryAfter the header, seconds or a date (RFC 9110, 10.2.3)
 * @param times how often this picture was asked for again already
 */
export function pauseMs(
  retryAfter: string | undefined,
  times: number,
  nowMs: number = Date.now(),
  chance: number = Math.random(),
): number | undefined {
  const saidMs = retryAfter === undefined ? undefined : readMs(retryAfter.trim(), nowMs);
  if (saidMs === undefined || saidMs > LONGEST_MS) return undefined;
  const grownMs = Math.min(Math.max(saidMs, LEAST_MS) * 2 ** times, LONGEST_MS);
  return grownMs * (1 + JITTER * chance);
}

/** Whether a pause was waited through: at once not when `signal` says that nobody wants the picture any more. */
export function waited(pauseMs: number, signal: AbortSignal): Promise<boolean> {
  if (signal.aborted) return Promise.resolve(false);
  return new Promise((resolve) => {
    const giveUp = (): void => end(false);
    const timer = setTimeout(() => end(true), pauseMs);
    const end = (isOver: boolean): void => {
      clearTimeout(timer);
      signal.removeEventListener("abort", giveUp);
      resolve(isOver);
    };
    signal.addEventListener("abort", giveUp, { once: true });
  });
}

/** Asks for a picture that others wait for: again where the server has too much to do and says when to come, as often as for a tile. */
export async function askedAgain<T>(ask: () => Promise<T>, signal: AbortSignal): Promise<T> {
  for (let times = 0; ; times += 1) {
    try {
      return await ask();
    } catch (error) {
      const isRefused = error instanceof ApiError && error.kind === "refused" && times < MOST_TIMES;
      const pause = isRefused ? pauseMs(error.retryAfter, times) : undefined;
      if (pause === undefined || !(await waited(pause, signal))) throw error;
    }
  }
}

function readMs(text: string, nowMs: number): number | undefined {
  if (/^\d+$/.test(text)) return Number(text) * 1000;
  // Browsers take much for a date, "-1" too: one of HTTP begins with the day of the week.
  const atMs = /^[A-Z][a-z]/.test(text) ? Date.parse(text) : Number.NaN;
  return Number.isNaN(atMs) ? undefined : Math.max(0, atMs - nowMs);
}
