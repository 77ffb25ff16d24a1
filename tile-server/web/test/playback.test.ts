//! Playback against a presenter of paper: how often it asks for what does not come.
import { afterEach, beforeEach, expect, it, vi } from "vitest";
import type { LayerSpec } from "../src/globe/layer";
import type { Presenter } from "../src/globe/presenter";
import type { Prepared } from "../src/globe/stage";
import { progressText } from "../src/panels/controls";
import { INITIAL, Store } from "../src/state/store";
import { Playback } from "../src/time/playback";
import { parseSteps } from "../src/time/steps";

const STEPS = parseSteps(
  [1, 2, 3].map((month) => ({
    start: `2000-0${month}-01T00:00:00Z`,
    end: `2000-0${month + 1}-01T00:00:00Z`,
    mid: `2000-0${month}-15T00:00:00Z`,
  })),
);

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal("requestAnimationFrame", (call: () => void) => setTimeout(call, 16));
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

/** Plays at four steps a second for a while; the answer is how many layers were asked for. */
async function askedIn(
  playedMs: number,
  comes: (spec: LayerSpec) => Prepared | null,
  { loadMs = 0, waited = [] }: { loadMs?: number; waited?: (number | undefined)[] } = {},
): Promise<number> {
  const store = new Store({ ...INITIAL, timeMs: STEPS[0]?.startMs ?? 0, stepsPerSecond: 4 });
  let asked = 0;
  const presenter = {
    preload: async (spec: LayerSpec) => {
      asked += 1;
      if (loadMs > 0) await new Promise((resolve) => setTimeout(resolve, loadMs));
      return comes(spec);
    },
    reveal: () => undefined,
    discard: () => undefined,
  };
  const specAt = (timeMs: number) =>
    ({ product: "flux", mode: "map", look: INITIAL.look, timeIso: String(timeMs) }) as unknown as LayerSpec;
  const follower = { isFollowing: false, lagMs: 0 };
  new Playback(store, presenter as unknown as Presenter, () => STEPS, specAt, follower, (timeMs) => waited.push(timeMs));
  store.set({ playing: true });
  await vi.advanceTimersByTimeAsync(playedMs);
  store.set({ playing: false });
  await vi.advanceTimersByTimeAsync(1_000);
  return asked;
}

it("what does not come is not asked for with every frame of the screen", async () => {
  expect(await askedIn(2_000, () => null)).toBeLessThanOrEqual(9);
});

it("what comes is shown when it is due", async () => {
  const asked = await askedIn(2_000, (spec) => ({ spec }) as Prepared);
  // Eight parts of a step, four steps a second.
  expect(asked).toBeGreaterThan(50);
  expect(asked).toBeLessThan(70);
});

it("says which instant is waited for where pictures come slowly, and nothing where they come in time", async () => {
  const comes = (spec: LayerSpec) => ({ spec }) as Prepared;
  const swift: (number | undefined)[] = [];
  await askedIn(2_000, comes, { loadMs: 50, waited: swift });
  expect(swift.filter((timeMs) => timeMs !== undefined)).toEqual([]);
  const slow: (number | undefined)[] = [];
  await askedIn(7_000, comes, { loadMs: 3_000, waited: slow });
  const told = slow.filter((timeMs) => timeMs !== undefined);
  // One for each picture that was waited for, each later than the one before; none is waited for at the end.
  expect(told.length).toBeGreaterThanOrEqual(2);
  expect(told).toEqual([...new Set(told)].sort((a, b) => a - b));
  expect(slow.at(-1)).toBeUndefined();
});

it("the line of what is on its way names the date that is waited for, before tiles", () => {
  expect(progressText(3, Date.UTC(2000, 6, 16, 12))).toBe("Loading 16 Jul 2000 …");
  expect(progressText(1, undefined)).toBe("1 tile on the way");
  expect(progressText(0, undefined)).toBe("");
});
