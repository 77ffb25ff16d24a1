//! What a film shows when, and sizes that the server draws.
import { describe, expect, it } from "vitest";
import { MOST_PIXELS, MOST_SIDE_PX, within } from "../src/api/pictures";
import { type FilmPlan, frameCount, instants, problemOf } from "../src/film/plan";

const plan = (change: Partial<FilmPlan> = {}): FilmPlan => ({
  startMs: 0,
  endMs: 1000,
  seconds: 2,
  framesPerSecond: 3,
  ...change,
});

describe("a film", () => {
  it("begins at the start, ends at the end and runs evenly", () => {
    expect(instants(plan())).toEqual([0, 200, 400, 600, 800, 1000]);
    expect(frameCount(plan({ seconds: 0.5, framesPerSecond: 25 }))).toBe(13);
    expect(problemOf(plan())).toBeUndefined();
  });

  it("says what is wrong before anything is asked", () => {
    expect(problemOf(plan({ startMs: Number.NaN }))).toContain("first and a last day");
    expect(problemOf(plan({ endMs: 0 }))).toContain("after the first");
    expect(problemOf(plan({ framesPerSecond: 0 }))).toContain("1 to 60");
    expect(problemOf(plan({ framesPerSecond: Number.NaN }))).toContain("1 to 60");
    expect(problemOf(plan({ seconds: 0.1 }))).toContain("would have 0");
    expect(problemOf(plan({ seconds: 1201 }))).toContain("3603");
    expect(problemOf(plan({ seconds: Number.NaN }))).toContain("2 to 3600 frames");
  });
});

describe("a picture", () => {
  it("has the window's shape and no more pixels than the server draws", () => {
    expect(within(MOST_SIDE_PX, 7680, 4320)).toEqual({ width: 7680, height: 4320 });
    for (const [width, height] of [
      [7680, 4800],
      [5000, 7680],
      [7680, 7680],
      [7679, 7001],
      [30_000, 100],
    ] as const) {
      const size = within(MOST_SIDE_PX, width, height);
      expect(size.width * size.height).toBeLessThanOrEqual(MOST_PIXELS);
      expect(Math.max(size.width, size.height)).toBeLessThanOrEqual(MOST_SIDE_PX);
      expect(size.width / size.height / (width / height)).toBeCloseTo(1, 1);
    }
  });
});
