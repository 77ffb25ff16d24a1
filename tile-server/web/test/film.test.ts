//! What a film shows when, and sizes that the server draws.
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { MOST_PIXELS, MOST_SIDE_PX, within } from "../src/api/pictures";
import { type Coverage, type FilmPlan, frameCount, instants, problemOf } from "../src/film/plan";
import type { LayerSpec } from "../src/globe/layer";
import { USUAL } from "../src/look/look";
import { FilmForm } from "../src/panels/film-form";
import { specAt } from "../src/panels/view";
import { paperDocument, type PaperElement } from "./paper-page";

const at = (iso: string): number => Date.parse(iso);
const YEAR: Coverage = { startMs: at("2000-01-01T00:00:00Z"), endMs: at("2001-01-01T00:00:00Z") };

const ALL: Coverage = { startMs: 0, endMs: 1000 };
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
    expect(problemOf(plan(), ALL)).toBeUndefined();
  });

  it("says what is wrong before anything is asked", () => {
    expect(problemOf(plan({ startMs: Number.NaN }), ALL)).toContain("first and a last day");
    expect(problemOf(plan({ endMs: 0 }), ALL)).toContain("after the first");
    expect(problemOf(plan({ framesPerSecond: 0 }), ALL)).toContain("1 to 60");
    expect(problemOf(plan({ framesPerSecond: Number.NaN }), ALL)).toContain("1 to 60");
    expect(problemOf(plan({ seconds: 0.1 }), ALL)).toContain("would have 0");
    expect(problemOf(plan({ seconds: 1201 }), ALL)).toContain("3603");
    expect(problemOf(plan({ seconds: Number.NaN }), ALL)).toContain("2 to 3600 frames");
  });
});

describe("a film of days that there is nothing of", () => {
  const days = (from: string, to: string) => plan({ startMs: at(from), endMs: at(to) });

  it("is refused with what there is, for its pictures would stand still", () => {
    expect(problemOf(days("2000-01-01", "2001-01-01"), YEAR)).toBeUndefined();
    expect(problemOf(days("2000-03-01", "2000-03-02"), YEAR)).toBeUndefined();
    const told = "There is nothing of all of 1999-12-31 to 2000-03-01: the product covers 2000-01-01 to 2000-12-31.";
    expect(problemOf(days("1999-12-31", "2000-03-02"), YEAR)).toContain(told);
    expect(problemOf(days("2000-12-31", "2001-01-02"), YEAR)).toContain("covers 2000-01-01 to 2000-12-31");
  });

  it("is none where parts of the first and the last day are covered", () => {
    const coverage = { startMs: at("2000-01-01T09:00:00Z"), endMs: at("2000-01-03T06:00:00Z") };
    expect(problemOf(days("2000-01-01", "2000-01-04"), coverage)).toBeUndefined();
    const spec: LayerSpec = {
      product: "flux",
      manifest: "flux@1-e9715079",
      revision: 0,
      mode: "map",
      look: USUAL,
      timeIso: "2000-01-02T00:00:00Z",
      bounds: [-180, -90, 180, 90],
    };
    const times = ["2000-01-01T00:00:00Z", "2000-01-02T12:00:00Z", "2000-01-04T00:00:00Z"].map((iso) => specAt(spec, coverage, at(iso)));
    expect(times.map((each) => each.timeIso)).toEqual(["2000-01-01T09:00:00Z", "2000-01-02T12:00:00Z", "2000-01-03T06:00:00Z"]);
    expect(times.every((each) => each.manifest === spec.manifest)).toBe(true);
  });
});

describe("the form", () => {
  beforeEach(() => void vi.stubGlobal("document", paperDocument()));
  afterEach(() => void vi.unstubAllGlobals());

  const NEXT: Coverage = { startMs: at("2010-05-01T00:00:00Z"), endMs: at("2010-06-01T00:00:00Z") };

  function made(coverage: Coverage): { form: FilmForm; field: (id: string) => PaperElement } {
    const addressAt = () => expect.unreachable("no frame is asked for");
    const form = new FilmForm(() => ({ name: "flux-map", width: 2, height: 2, coverage, addressAt }));
    const paper = form.element as unknown as PaperElement;
    return { form, field: (id) => paper.find(id) ?? expect.unreachable(id) };
  }

  it("offers each product's own period to whoever typed none", () => {
    const { form, field } = made(NEXT);
    const days = () => [field("film-from").value, field("film-to").value];
    form.offer(undefined);
    expect(days()).toEqual(["", ""]);
    form.offer(YEAR);
    expect(days()).toEqual(["2000-01-01", "2000-12-31"]);
    form.offer(NEXT);
    expect(days()).toEqual(["2010-05-01", "2010-05-31"]);
    field("film-to").value = "2010-05-09";
    form.offer(YEAR);
    expect(days()).toEqual(["2010-05-01", "2010-05-09"]);
  });

  it("says that a period lies beyond what there is, and asks for nothing", () => {
    const { form, field } = made(NEXT);
    form.offer(YEAR);
    (form.element as unknown as PaperElement).tell("submit");
    expect(field("film-says").textContent).toContain("the product covers 2010-05-01 to 2010-05-31");
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
