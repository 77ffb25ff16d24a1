//! The shareable address, series values, cross-fades, ticks and files: pure parts of what the page shows.
import { afterEach, describe, expect, it } from "vitest";
import type { Quantity } from "../src/api/types";
import { MODES } from "../src/api/words";
import { underOpacity } from "../src/globe/fade";
import { tickTexts, ticksOf } from "../src/look/legend";
import { rowTexts } from "../src/panels/budget";
import { budgetCsv, seriesCsv } from "../src/panels/csv";
import { hasData, heldAt, heldSamplesOf, missingText, samplesOf, valueAt } from "../src/panels/series";
import { isLinear } from "../src/state/catalogue";
import { decodeHash, encodeHash } from "../src/state/hash";
import { INITIAL, type State, Store } from "../src/state/store";

describe("the address", () => {
  const state: State = {
    ...INITIAL,
    product: "takahashi09 flux/é",
    mode: "volume",
    timeMs: Date.parse("2000-07-04T05:06:07Z"),
    opacity: 0.35,
    place: { lon: -150.25, lat: 3.5 },
    tab: "budget",
    region: "170,-10,-170,10",
    camera: { lon: 12.5, lat: -40, heightKm: 5000, headingDeg: 20, pitchDeg: -60, rollDeg: 0 },
  };

  it("carries a view there and back", () => {
    expect({ ...INITIAL, ...decodeHash(encodeHash(state)) }).toEqual(state);
  });

  it("knows every mode", () => {
    for (const mode of MODES) expect(decodeHash(`#mode=${mode}`)).toEqual({ mode });
    expect(MODES).toContain("flow");
  });

  it("says that the live picture is off, and where the camera leans", () => {
    const leaning = { ...state, live: false, camera: { ...state.camera, rollDeg: -7.5 } };
    expect(encodeHash(leaning)).toMatch(/camera=12.5,-40,5000,20,-60,-7.5&.*&live=off$/);
    expect({ ...INITIAL, ...decodeHash(encodeHash(leaning)) }).toEqual(leaning);
    expect(decodeHash("#live=on&live=maybe")).toEqual({ live: true });
  });

  it("leaves out what is as it is at first", () => {
    expect(encodeHash(INITIAL)).toBe("#mode=map&camera=-150,8,15000");
  });

  it("takes nothing from nonsense", () => {
    expect(decodeHash("#mode=fog&time=soon&camera=1,2&opacity=7&place=0,95&tab=x&product=%E0%A4%A&=&&")).toEqual({});
  });
});

describe("an instant in the address", () => {
  const read = (text: string): string | undefined => {
    const { timeMs } = decodeHash(`#time=${text}`);
    return timeMs === undefined ? undefined : new Date(timeMs).toISOString();
  };
  const home = process.env["TZ"];
  afterEach(() => {
    if (home === undefined) delete process.env["TZ"];
    else process.env["TZ"] = home;
  });

  it("is the same wherever its reader sits", () => {
    process.env["TZ"] = "Asia/Tokyo";
    expect(new Date(2000, 0, 1).getTimezoneOffset(), "the clock is that of Tokyo").toBe(-540);
    expect(read("2000-07-04T05:06")).toBe("2000-07-04T05:06:00.000Z");
    expect(read("2000-07-04T05:06:07.5")).toBe("2000-07-04T05:06:07.500Z");
    expect(read("2000-07-04T05:06:07Z")).toBe("2000-07-04T05:06:07.000Z");
    expect(read("2000-07-04T05:06:07+09:00")).toBe("2000-07-03T20:06:07.000Z");
    expect(read("2000-07-04")).toBe("2000-07-04T00:00:00.000Z");
    expect(read("2000-07")).toBe("2000-07-01T00:00:00.000Z");
    expect(read("2000")).toBe("2000-01-01T00:00:00.000Z");
  });

  it("is none where it is not written as one", () => {
    for (const text of ["5", "20000", "4 Jul 2000", "7/4/2000", "2000-13-01", "2000-07-04T25:00", "2000-07-04T05", ""])
      expect(read(text), text).toBeUndefined();
  });
});

describe("the store", () => {
  it("tells only those who listen to what changed", () => {
    const store = new Store(INITIAL);
    const heard: string[] = [];
    store.on(["mode"], () => heard.push("mode"));
    store.on(["timeMs", "mode"], () => heard.push("either"));
    store.set({ timeMs: 5 });
    store.set({ timeMs: 5 });
    expect(heard).toEqual(["either"]);
    store.set({ mode: "volume" });
    expect(heard).toEqual(["either", "mode", "either"]);
  });
});

describe("a series", () => {
  const samples = [
    { atMs: 0, value: 10 },
    { atMs: 100, value: 20 },
    { atMs: 200, value: null },
    { atMs: 300, value: 5 },
  ];

  it("is linear between middles and holds at the ends", () => {
    expect(valueAt(samples, 25)).toBe(12.5);
    expect(valueAt(samples, -50)).toBe(10);
    expect(valueAt(samples, 900)).toBe(5);
  });

  it("has no value beside a gap, but has one on the middle before it", () => {
    expect(valueAt(samples, 150)).toBeNull();
    expect(valueAt(samples, 250)).toBeNull();
    expect(valueAt(samples, 100)).toBe(20);
    expect(valueAt(samples, 200)).toBeNull();
  });

  it("of codes holds each from its start to its end", () => {
    const months = ["01", "02", "03"].map((month) => `2000-${month}-01T00:00:00Z`);
    const row = (from: number, value: number) => ({
      start: months[from] as string,
      mid: months[from] as string,
      end: months[from + 1] as string,
      value,
    });
    const codes = heldSamplesOf([row(0, 1), row(1, 5)]);
    const at = (time: string) => heldAt(codes, Date.parse(time));
    expect(at("1999-07-01")).toBe(1);
    expect(at("2000-01-31T23:00:00Z")).toBe(1);
    expect(at("2000-02-01")).toBe(5);
    expect(at("2001-01-01")).toBe(5);
    expect(heldAt([], 0)).toBeNull();
    const open = { name: "basin", title: "Basin", unit: "1" };
    expect(isLinear({ ...open, flags: [{ value: 1, meaning: "pacific" }] } as Quantity)).toBe(false);
    expect(isLinear({ ...open, unit: "degree" } as Quantity)).toBe(false);
    expect(isLinear({ ...open, unit: "degree_C" } as Quantity)).toBe(true);
    expect(isLinear("carbon_flux")).toBe(true);
  });

  it("of gaps alone has no data", () => {
    expect(hasData([{ atMs: 0, value: null }])).toBe(false);
    expect(hasData(samples)).toBe(true);
    expect(valueAt([], 0)).toBeNull();
  });
});

describe("a series of sums", () => {
  const sum = (start: string, end: string, value: number | null, steps = 0, of_steps = 0, time_percent = 0) => ({
    start: `2000-${start}-01T00:00:00Z`,
    end: `2000-${end}-01T00:00:00Z`,
    mid: `2000-${start}-16T00:00:00Z`,
    value,
    ...(of_steps > 0 ? { contributed: { steps, of_steps, time_percent } } : {}),
  });
  const SUMS = [sum("01", "02", 10, 1, 1, 100), sum("02", "03", 10, 1, 2, 51.7), sum("03", "04", 30, 2, 3, 68.1)];
  const at = (iso: string): number => Date.parse(iso);

  it("grows from zero at the first start, and each is whole at the end of its period", () => {
    const samples = samplesOf(SUMS, "end");
    expect(valueAt(samples, at("2000-01-01T00:00:00Z"))).toBe(0);
    expect(valueAt(samples, at("1999-01-01T00:00:00Z"))).toBe(0);
    expect(valueAt(samples, at("2000-01-16T12:00:00Z"))).toBe(5);
    expect(valueAt(samples, at("2000-02-01T00:00:00Z"))).toBe(10);
    expect(valueAt(samples, at("2000-03-16T12:00:00Z"))).toBe(20);
    expect(valueAt(samples, at("2000-04-01T00:00:00Z"))).toBe(30);
  });

  it("holds means at their middles all the same", () => {
    const samples = samplesOf(SUMS, "mid");
    expect(samples.map((sample) => sample.atMs)).toEqual(SUMS.map((row) => at(row.mid)));
    expect(valueAt(samples, at("2000-01-01T00:00:00Z"))).toBe(10);
  });

  it("has nothing where its first sum has no data, not even zero", () => {
    const land = samplesOf([sum("01", "02", null), sum("02", "03", null)], "end");
    expect(hasData(land)).toBe(false);
    expect(valueAt(samplesOf([sum("01", "02", null), sum("02", "03", 4)], "end"), at("2000-01-01T00:00:00Z"))).toBeNull();
    expect(samplesOf([], "end")).toEqual([]);
  });

  it("says what is missing of a sum, and nothing of a complete one", () => {
    const samples = samplesOf(SUMS, "end");
    expect(missingText(samples, at("2000-01-20T00:00:00Z"))).toBe("");
    expect(missingText(samples, at("2000-03-01T00:00:00Z"))).toBe(
      "Not complete: 1 of 2 periods had data, 51.7 % of the time.",
    );
    expect(missingText(samples, at("2020-03-01T00:00:00Z"))).toContain("2 of 3 periods");
    expect(missingText([{ atMs: 0, value: 1 }], 0)).toBe("");
  });
});

describe("a cross-fade", () => {
  it("never changes what the pair covers", () => {
    for (const whole of [0.2, 0.9, 1]) {
      for (let upper = 0; upper < whole; upper += 0.05) {
        const under = underOpacity(whole, upper);
        expect(upper + (1 - upper) * under).toBeCloseTo(whole, 12);
      }
      expect(underOpacity(whole, whole)).toBe(0);
    }
  });
});

describe("legend ticks", () => {
  it("are round and inside", () => {
    expect(ticksOf(-60, 60)).toEqual([-50, -25, 0, 25, 50]);
    expect(ticksOf(0, 1)).toEqual([0, 0.2, 0.4, 0.6000000000000001, 0.8, 1]);
    expect(ticksOf(5, 5)).toEqual([5]);
  });

  it("are written as the server's drawings have them", () => {
    expect(tickTexts([-1, 0, 0.5])).toEqual(["−1.0", "0.0", "0.5"]);
    expect(tickTexts([-20, 0, 20])).toEqual(["−20", "0", "20"]);
    expect(tickTexts(ticksOf(0, 1))).toEqual(["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
    expect(tickTexts([0, 2.5e-9])).toEqual(["0", "2.5e−9"]);
    expect(tickTexts([0, 2e6])).toEqual(["0", "2e6"]);
    expect(tickTexts([])).toEqual([]);
  });
});

describe("the budget's rows", () => {
  it("have the decimals of the largest, at least two, and none is zero that is not", () => {
    expect(rowTexts([-117.034, 3.1])).toEqual(["−117.03", "3.10"]);
    expect(rowTexts([0.00123, -0.0004])).toEqual(["0.001230", "−0.000400"]);
    expect(rowTexts([3e-7, -1.5e-8])).toEqual(["3e−7", "−1.5e−8"]);
    expect(rowTexts([])).toEqual([]);
  });
});

describe("files", () => {
  const row = { start: "2000-01-01T00:00:00Z", end: "2000-02-01T00:00:00Z" };
  const SERIES = {
    product: "p",
    manifest: "m-1",
    title: "A flux",
    source: "somebody",
    synthetic: false,
    quantity: "carbon_flux",
    unit: "g C m-2 yr-1",
    lon_deg: 0,
    lat_deg: 0,
    cell: { row: 1, col: 2, lon_deg: 0.5, lat_deg: 0.5 },
  } as const;

  it("of a budget say where the numbers come from", () => {
    const text = budgetCsv({
      product: "p",
      manifest: "m-1",
      title: "A flux",
      source: "somebody",
      synthetic: false,
      region: "global",
      earth: "wgs84",
      cells: "whole",
      unit: "Tg C",
      region_area_m2: 5e14,
      ocean_area_m2: 3.6e14,
      ocean_source: "a coast",
      gap_basis: "means of bands",
      notes: ["taken as written"],
      rows: [
        {
          ...row,
          budget_kg: "-176100000000.000000000",
          budget_tg: -176.1,
          coverage_percent: 92.5,
          area_m2: 3e14,
          region_area_m2: 5e14,
          ocean_area_m2: 3.6e14,
          ocean_with_data_m2: 2.9e14,
          gap_tg: null,
          gap_area_m2: 0,
        },
      ],
    });
    expect(text).toBe(
      "# product: p\n# manifest: m-1\n# region: global\n# earth: wgs84\n# cells: whole\n# unit: Tg C\n# region area: 500000000000000 m2, ocean 360000000000000 m2 (a coast)\n# gap, no part of the budget: means of bands\n# note: taken as written\nstart,end,budget_tg,coverage_percent,area_m2,ocean_with_data_m2,gap_tg,gap_area_m2\n2000-01-01T00:00:00Z,2000-02-01T00:00:00Z,-176.1,92.5,300000000000000,290000000000000,,0\n",
    );
  });

  it("of sums say what these hold, where that is known", () => {
    const sum = { ...row, mid: "2000-01-16T12:00:00Z", value: 1.5 };
    const counts = { steps: 1, of_steps: 2, time_percent: 51.7 };
    const rows = seriesCsv({ ...SERIES, series: [{ ...sum, contributed: counts }, sum] }).trimEnd().split("\n").slice(-3);
    expect(rows).toEqual([
      "start,end,mid,value,contributed_steps,contributed_of_steps,contributed_time_percent",
      `${sum.start},${sum.end},${sum.mid},1.5,1,2,51.7`,
      `${sum.start},${sum.end},${sum.mid},1.5,,,`,
    ]);
  });

  it("of a series leave gaps empty", () => {
    const text = seriesCsv({ ...SERIES, series: [{ ...row, mid: "2000-01-16T12:00:00Z", value: null }] });
    expect(text).toContain("\nstart,end,mid,value\n");
    expect(text.trimEnd().endsWith(",2000-01-16T12:00:00Z,")).toBe(true);
  });
});
