//! What the catalogue says of products: titles of what is new, each once, legends of the versions that it has, when values hold, and what was missed.
import { describe, expect, it } from "vitest";
import type { Product } from "../src/api/types";
import { Catalogue } from "../src/state/catalogue";

function product(id: string, title: string, derived_from: string | null = null): Product {
  return {
    product: id,
    title,
    quantity: "carbon_flux",
    unit: "",
    stored_unit: "",
    display_factor: 1,
    display_offset: 0,
    synthetic: false,
    source: "",
    manifest: `${id}@1-00000000`,
    derived_from,
    rows: 180,
    cols: 360,
    bounds_deg: [-180, -90, 180, 90],
    step_count: 0,
    start: null,
    end: null,
    masked: { out_of_range: 0, poor_quality: 0, implausible: 0, steps: 0, uncounted_steps: 0 },
    steps: [],
    modes: ["map"],
    pinned: [],
    legend: { low: 0, high: 1, unit: "", label: "", stops: [], ticks: [] },
  };
}

describe("titles of news", () => {
  const catalogue = new Catalogue([
    product("flux", "CO2 flux"),
    product("flux-accumulated", "CO2 flux, accumulated", "flux@1-00000000"),
  ]);

  it("are told once and typeset, and what follows from one of them is not", () => {
    expect(catalogue.titlesOf(["flux", "flux-accumulated", "flux"])).toEqual(["CO₂ flux"]);
    expect(catalogue.titlesOf(["flux-accumulated"])).toEqual(["CO₂ flux, accumulated"]);
    expect(catalogue.titlesOf(["a-stranger"])).toEqual(["a-stranger"]);
  });
});

describe("a legend", () => {
  const catalogue = new Catalogue([product("flux", "CO2 flux")]);

  it("is the product's own as long as its version is the one that is here", () => {
    expect(catalogue.usualLegend("flux", "map")?.high).toBe(1);
    expect(catalogue.usualLegend("flux", "map", "flux@1-00000000")?.high).toBe(1);
    expect(catalogue.usualLegend("flux", "map", "flux@2-00000000")).toBeUndefined();
  });
});

describe("the instant that a step's values are those of", () => {
  const steps = [{ start: "2000-01-01T00:00:00Z", end: "2000-02-01T00:00:00Z", mid: "2000-01-16T12:00:00Z" }];
  const catalogue = new Catalogue([
    { ...product("flux", "CO2 flux"), steps },
    { ...product("flux-accumulated", "CO2 flux, accumulated"), quantity: "accumulated_carbon", steps },
  ]);

  it("is the middle, and of accumulated carbon the end, as pictures draw it", () => {
    const at = (id: string) => catalogue.stepsOf(id).map((step) => new Date(step.atMs).toISOString());
    expect(at("flux")).toEqual(["2000-01-16T12:00:00.000Z"]);
    expect(at("flux-accumulated")).toEqual(["2000-02-01T00:00:00.000Z"]);
  });
});

describe("what was missed", () => {
  const period = { start: "2000-01-01T00:00:00Z", end: "2001-01-01T00:00:00Z" };
  const flux = { ...product("flux", "CO2 flux"), ...period };
  const sum: Product = {
    ...product("flux-accumulated", "CO2 flux, accumulated", "flux@1-00000000"),
    quantity: "accumulated_carbon",
  };
  const sst = product("sst", "Temperature");
  const before = new Catalogue([flux, sum, sst]);
  const told = (products: Product[]) => new Catalogue(products, before).newsSince(before);

  it("is every version that is another one, at all of its times, and what is there for the first time", () => {
    expect(told([flux, sum, sst])).toEqual([]);
    expect(told([{ ...flux, manifest: "flux@2-00000000" }, sum, sst])).toEqual([
      { product: "flux", manifest: "flux@2-00000000", touched: [period] },
    ]);
    expect(told([flux, sum, sst, product("wind", "Wind")]).map((news) => news.product)).toEqual(["wind"]);
  });

  it("is the same version again where others lift its particles now", () => {
    const lifted = told([flux, { ...sum, manifest: "flux-accumulated@2-00000000" }, sst]);
    expect(lifted.map((news) => news.manifest)).toEqual([flux.manifest, "flux-accumulated@2-00000000"]);
  });

  it("is nothing before there was a list", () => {
    expect(before.newsSince(new Catalogue([]))).toEqual([]);
  });
});
