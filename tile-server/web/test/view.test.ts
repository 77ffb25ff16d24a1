//! The shareable address, series values, cross-fades, ticks and files: pure parts of what the page shows.
import { describe, expect, it } from "vitest";
import { MODES } from "../src/api/words";
import { underOpacity } from "../src/globe/fade";
import { ticksOf } from "../src/look/legend";
import { budgetCsv, seriesCsv } from "../src/panels/csv";
import { hasData, valueAt } from "../src/panels/series";
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
    { midMs: 0, value: 10 },
    { midMs: 100, value: 20 },
    { midMs: 200, value: null },
    { midMs: 300, value: 5 },
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

  it("of gaps alone has no data", () => {
    expect(hasData([{ midMs: 0, value: null }])).toBe(false);
    expect(hasData(samples)).toBe(true);
    expect(valueAt([], 0)).toBeNull();
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
});

describe("files", () => {
  const row = { start: "2000-01-01T00:00:00Z", end: "2000-02-01T00:00:00Z" };

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

  it("of a series leave gaps empty", () => {
    const text = seriesCsv({
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
      series: [{ ...row, mid: "2000-01-16T12:00:00Z", value: null }],
    });
    expect(text.trimEnd().endsWith(",2000-01-16T12:00:00Z,")).toBe(true);
  });
});
