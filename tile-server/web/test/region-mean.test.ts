//! The mean over a region of what is no flux: at which instants its values are, and what is said of it.
import { afterEach, beforeEach, expect, it, vi } from "vitest";
import type { RegionMeans } from "../src/api/types";
import { areaUrl } from "../src/api/requests";
import { BudgetForm } from "../src/panels/budget-form";
import { meanSamples, meanView } from "../src/panels/region-mean";
import { paperDocument, PaperElement } from "./paper-page";

beforeEach(() => void vi.stubGlobal("document", paperDocument()));
afterEach(() => void vi.unstubAllGlobals());

const JANUARY = { start: "2010-01-01T00:00:00Z", mid: "2010-01-16T12:00:00Z", end: "2010-02-01T00:00:00Z" };
const FEBRUARY = { start: "2010-02-01T00:00:00Z", mid: "2010-02-15T00:00:00Z", end: "2010-03-01T00:00:00Z" };

const MEANS: RegionMeans = {
  product: "sst",
  manifest: "sst@1-7162806c",
  title: "Sea-surface temperature",
  source: "",
  synthetic: false,
  quantity: "sea_surface_temperature",
  unit: "degC",
  region: "-60,0,0,40",
  region_area_m2: 3e13,
  ocean_area_m2: 2e13,
  ocean_source: "",
  notes: ["planted: a note"],
  earth: "wgs84",
  series: [
    { ...JANUARY, mean: 19.316, area_m2: 1.8e13, coverage_percent: 93.9 },
    { ...FEBRUARY, mean: null, area_m2: 0, coverage_percent: 0 },
  ],
};

it("values stand at their middles, those of what accumulates at their ends, and gaps are gaps", () => {
  const of = (quantity: RegionMeans["quantity"]) => meanSamples({ ...MEANS, quantity });
  expect(of("sea_surface_temperature")).toEqual([
    { atMs: Date.parse(JANUARY.mid), value: 19.316 },
    { atMs: Date.parse(FEBRUARY.mid), value: null },
  ]);
  expect(of("accumulated_carbon").map(({ atMs }) => atMs)).toEqual([JANUARY.end, FEBRUARY.end].map(Date.parse));
});

it("is shown with the region, how much of its sea holds data, the server's notes and a row a period", () => {
  const page = new PaperElement();
  const plot = new PaperElement();
  const parts = meanView(MEANS, "A box", plot as unknown as HTMLElement, "http://host/area");
  page.append(...(parts as unknown as PaperElement[]));
  expect(page.text).toMatch(/A box: 30\.00 million km², 20\.00 million km² of it sea, of which 0\.0 to 93\.9 % hold data/);
  expect(page.text).toMatch(/planted: a note/);
  expect(page.text).toMatch(/2010-01-01\s+2010-02-01\s+19\.32\s+93\.9 %/);
  expect(page.text).toMatch(/2010-02-01\s+2010-03-01\s+–\s+0\.0 %/);
});

it("is asked for by region, period and earth: what only a sum goes by is not shown", () => {
  const query = { region: "global", from: "2010-01-01T00:00:00Z", to: "2011-01-01T00:00:00Z", earth: "wgs84" } as const;
  const url = new URL(areaUrl("sst", { ...query, step: "month", cells: "whole" }));
  expect(url.pathname).toBe("/api/products/sst/area");
  expect(Object.fromEntries(url.searchParams)).toEqual(query);
  const still = () => undefined;
  const form = new BudgetForm({ onChange: still, onRegion: still, drawBox: still, markRegion: still });
  const fields = (element: PaperElement): PaperElement[] =>
    element.children.flatMap((child) => (typeof child === "string" ? [] : [child, ...fields(child)]));
  const hidden = () =>
    fields(form.element as unknown as PaperElement)
      .filter((each) => each.hidden && (each.find("step") || each.find("cells")))
      .map((each) => each.text.trim().split(" ")[0]);
  form.showSumFields(false);
  expect(hidden()).toEqual(["Step", "Coast"]);
  form.showSumFields(true);
  expect(hidden()).toEqual([]);
});
