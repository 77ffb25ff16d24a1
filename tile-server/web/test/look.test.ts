//! The look of a layer: in addresses and back, what of it makes a difference, and what the panel offers.
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { globeUrl, queryOf, tileTemplate } from "../src/api/pictures";
import type { Palette, Product } from "../src/api/types";
import { isSameLayer, layerKey, type LayerSpec } from "../src/globe/layer";
import { changeOf, colourParameters, parameters, parseRange, viewParameters } from "../src/look/address";
import { effective, type Look, possible, USUAL, withoutColours } from "../src/look/look";
import { offerOf } from "../src/look/offer";
import { RangeForm } from "../src/look/range-form";
import { Catalogue } from "../src/state/catalogue";
import { decodeHash, encodeHash } from "../src/state/hash";
import { INITIAL, type State } from "../src/state/store";
import { paperDocument, type PaperElement } from "./paper-page";

beforeEach(() => vi.stubGlobal("document", { baseURI: "http://host/below/" }));
afterEach(() => vi.unstubAllGlobals());

const FULL: Look = {
  palette: "ice",
  reversed: true,
  range: { low: -10, high: 2.5 },
  scale: "linear",
  uncertainty: true,
  relief: "etopo20",
  reliefExaggeration: 40,
  seaOpacity: 0.35,
  coastlines: true,
  isolines: true,
  heightMPerKgM2: 4_000_000,
  sunOfTime: true,
};
const FULL_QUERY =
  "palette=ice&range=-10:2.5&scale=linear&reverse=true&uncertainty=true&relief=etopo20&relief_exaggeration=40&sea_opacity=0.35&coastlines=true&isolines=auto&height_exaggeration=4000000&sun=time";

const BALANCE: Palette = { name: "balance", stops: [[0, "#11387f"], [0.5, "#f0f0ee"], [1, "#760e24"]] };
const ICE: Palette = { name: "ice", stops: [[0, "#030512"], [1, "#eafcfd"]] };

function product(id: string, change: Partial<Product> = {}): Product {
  const steps = [{ start: "2000-01-01T00:00:00Z", end: "2000-02-01T00:00:00Z", mid: "2000-01-16T12:00:00Z" }];
  return {
    product: id,
    title: `The ${id}`,
    quantity: "carbon_flux",
    unit: "",
    stored_unit: "",
    display_factor: 1,
    display_offset: 0,
    synthetic: false,
    source: "",
    manifest: `${id}@1-00000000`,
    derived_from: null,
    rows: 180,
    cols: 360,
    bounds_deg: [-180, -90, 180, 90],
    step_count: 0,
    start: null,
    end: null,
    masked: { out_of_range: 0, poor_quality: 0, implausible: 0, steps: 0, uncounted_steps: 0 },
    steps,
    modes: ["map", "volume"],
    pinned: [],
    legend: { low: -40, high: 40, unit: "g C m⁻² yr⁻¹", label: "", stops: BALANCE.stops, ticks: [] },
    ...change,
  };
}

const SPEEDS = { low: 0, high: 1.5, unit: "m s⁻¹", label: "Speed", stops: ICE.stops, ticks: [] };
const CATALOGUE = new Catalogue([
  product("flux"),
  product("flux-accumulated", { quantity: "accumulated_carbon", derived_from: "flux@1-00000000" }),
  product("sea-east-smooth", { quantity: "current", derived_from: "sea-east@1-00000000" }),
  product("etopo20", { quantity: "elevation", title: "ETOPO5" }),
  product("etopo5", { quantity: "elevation", steps: [] }),
  product("sea-east", { quantity: "current", flow_legend: SPEEDS }),
]);

function state(change: Partial<State>): State {
  return { ...INITIAL, product: "flux", timeMs: 0, ...change };
}

describe("a look in an address", () => {
  it("is written in the server's own words, and the usual one not at all", () => {
    expect(queryOf(parameters(FULL))).toBe(FULL_QUERY);
    expect(parameters(USUAL)).toEqual([]);
  });

  it("says of a view of the globe that it has no coast lines, which it would have", () => {
    expect(viewParameters(USUAL)).toEqual([["coastlines", "false"]]);
    expect(viewParameters(FULL)).toEqual(parameters(FULL));
  });

  it("comes back as it was", () => {
    const there = state({ look: FULL, mode: "volume", tab: "look" });
    expect({ ...INITIAL, ...decodeHash(encodeHash(there)) }).toEqual(there);
    expect(decodeHash(`#${FULL_QUERY}`)).toEqual({ look: FULL });
  });

  it("keeps what is valid beside what is not", () => {
    expect(decodeHash("#palette=ice&range=5:4&reverse=yes&sun=noon")).toEqual({ look: { ...USUAL, palette: "ice" } });
  });

  it("takes nothing from nonsense", () => {
    const nonsense: [string, string][] = [
      ["palette", ""],
      ["palette", "ICE"],
      ["palette", "a&b"],
      ["range", "1"],
      ["range", "1:"],
      ["range", ":1"],
      ["range", "2:1"],
      ["range", "1:1"],
      ["range", "0:1:2"],
      ["range", "0:Infinity"],
      ["range", "-1e30:1"],
      ["reverse", "1"],
      ["uncertainty", ""],
      ["coastlines", "false"],
      ["isolines", "10"],
      ["scale", "ln"],
      ["relief", "../etopo"],
      ["relief_exaggeration", ""],
      ["relief_exaggeration", "-1"],
      ["relief_exaggeration", "1001"],
      ["sea_opacity", "1"],
      ["sea_opacity", "half"],
      ["height_exaggeration", "2e9"],
      ["sun", "90,40"],
      ["constructor", "true"],
      ["toString", ""],
    ];
    for (const [name, value] of nonsense) expect(changeOf(name, value), `${name}=${value}`).toBeUndefined();
    expect(decodeHash("#range=9:1&sea_opacity=2&relief=%20")).toEqual({});
  });

  it("says nothing of how steep a relief is that is not there", () => {
    expect(parameters({ ...FULL, relief: null }).map(([name]) => name)).not.toContain("relief_exaggeration");
  });

  it("is a part of what tiles and views are asked for, and of what layers are told apart by", () => {
    const spec = CATALOGUE.layerAt(state({ look: FULL, mode: "volume" }), 0) as LayerSpec;
    const tile = new URL(tileTemplate("flux", "volume", spec.timeIso, spec, parameters(spec.look)));
    expect(tile.href.endsWith(`&${FULL_QUERY}`)).toBe(true);
    const size = { lon: 0, lat: 0, heightKm: 1, headingDeg: 12.5, pitchDeg: -30, rollDeg: 0, openingDeg: 45, width: 2, height: 2 };
    const view = new URL(globeUrl("flux", "volume", { ...size, timeIso: spec.timeIso, look: parameters(spec.look) }));
    expect([view.searchParams.get("heading"), view.searchParams.get("tilt")]).toEqual(["12.5", "60"]);
    for (const [name, value] of parameters(FULL)) {
      expect(tile.searchParams.get(name)).toBe(value);
      expect(view.searchParams.get(name)).toBe(value);
    }
    const usual = CATALOGUE.layerAt(state({ mode: "volume" }), 0) as LayerSpec;
    expect(layerKey(usual)).toMatch(/\/volume@[^?]*Z$/);
    expect(layerKey(spec)).toBe(layerKey(usual).replace("/volume@", `/volume?${FULL_QUERY}@`));
    const later = { ...spec, timeIso: "2000-01-20T00:00:00Z" };
    expect([isSameLayer(spec, later), isSameLayer(spec, usual)]).toEqual([true, false]);
  });

  it("has for its legend the colours alone", () => {
    expect(queryOf(colourParameters(FULL))).toBe("palette=ice&range=-10:2.5&scale=linear&reverse=true");
  });
});

describe("a range", () => {
  it("is two numbers that rise, and says what is wrong with others", () => {
    expect(parseRange(" -1.5 ", "2e2")).toEqual({ low: -1.5, high: 200 });
    expect(parseRange("", "1")).toMatch(/numbers/);
    expect(parseRange("a", "1")).toMatch(/numbers/);
    expect(parseRange("1", "1")).toMatch(/below/);
    expect(parseRange("2", "1")).toMatch(/below/);
    expect(parseRange("0", "1e21")).toMatch(/too large/);
  });
});

describe("of a look", () => {
  it("only what changes the picture is asked for", () => {
    const map = effective(FULL, "map", true);
    expect(map).toEqual({ ...FULL, heightMPerKgM2: USUAL.heightMPerKgM2 });
    expect(effective({ ...FULL, relief: null }, "map", true).seaOpacity).toBe(0);
    expect(effective({ ...FULL, relief: null }, "volume", true).seaOpacity).toBe(0.35);
    expect(effective({ ...FULL, relief: null }, "volume", false).seaOpacity).toBe(0);
    expect(effective(FULL, "volume", true)).toEqual(FULL);
    expect(effective(FULL, "flow", false).uncertainty).toBe(false);
  });

  it("what this server does not have is forgotten, and the rest kept as it is", () => {
    expect(possible(FULL, ["ice"], ["etopo20"])).toBe(FULL);
    expect(possible(FULL, ["gray"], ["etopo20"])).toEqual({ ...FULL, palette: null });
    expect(possible(FULL, ["ice"], [])).toEqual({ ...FULL, relief: null });
  });

  it("colours stay behind with the product they were chosen for", () => {
    expect(withoutColours(FULL)).toEqual({ ...FULL, palette: null, reversed: false, range: null, scale: null });
    const plain = { ...USUAL, coastlines: true };
    expect(withoutColours(plain)).toBe(plain);
  });
});

describe("the look panel", () => {
  const offer = (change: Partial<State>) => offerOf(CATALOGUE, [BALANCE, ICE], state(change));

  it("names the product's own palette, that of speeds in a flow", () => {
    const titles = (change: Partial<State>) => offer(change)?.palettes.map((palette) => palette.title);
    expect(titles({})).toEqual(["Balance (default)", "Ice"]);
    expect(titles({ product: "sea-east", mode: "flow" })).toEqual(["Balance", "Ice (default)"]);
    expect(titles({ product: "sea-east", mode: "map" })).toEqual(["Balance (default)", "Ice"]);
  });

  it("offers the product's own range, also while another one is chosen", () => {
    const look = { ...USUAL, range: { low: 1, high: 2 } };
    expect(offer({ look })).toMatchObject({ range: { low: -40, high: 40 }, unit: "g C m⁻² yr⁻¹" });
  });

  it("offers a logarithmic scale where the range that is shown lies above 0, and says why not elsewhere", () => {
    const problem = (change: Partial<State>) => offer(change)?.logProblem;
    const within = (low: number, high: number) => ({ look: { ...USUAL, range: { low, high } } });
    expect(problem({})).toBe("A logarithmic scale needs a range above 0; this one begins at −40.");
    expect(problem(within(0, 40))).toMatch(/begins at 0\.$/);
    expect(problem(within(0.1, 40))).toBe("");
    // The zero of degrees is another one than that of what is stored.
    const legend = { low: 2, high: 30, unit: "°C", label: "", stops: [], ticks: [] };
    const warm = new Catalogue([product("sst", { display_offset: -273.15, legend })]);
    expect(offerOf(warm, [], state({ product: "sst" }))?.logProblem).toMatch(/zero of °C/);
  });

  it("takes no range that begins below 0 on a logarithmic scale", () => {
    vi.stubGlobal("document", paperDocument());
    const taken: unknown[] = [];
    const form = new RangeForm((range) => taken.push(range));
    const page = form.element as unknown as PaperElement;
    const type = (low: string): string | null | undefined => {
      const input = page.find("range-low");
      if (input) input.value = low;
      input?.tell("change");
      return page.find("range-problem")?.textContent;
    };
    form.show(null, { low: 0.1, high: 10 }, "mg m-3", true);
    expect(type("-1")).toMatch(/above 0/);
    expect(type("1")).toBe("");
    form.show(null, { low: 0.1, high: 10 }, "mg m-3", false);
    expect(type("-1")).toBe("");
    expect(taken).toEqual([{ low: 1, high: 10 }, { low: -1, high: 10 }]);
  });

  it("offers elevations that have landed as reliefs", () => {
    expect(offer({})?.reliefs).toEqual([{ id: "etopo20", title: "ETOPO5" }]);
    const without = new Catalogue([product("flux")]);
    expect(offerOf(without, [], state({}))?.reliefs).toEqual([]);
  });

  it("offers sea and height where there is something below or above the sea", () => {
    const shown = (change: Partial<State>) => {
      const { canUncertainty, hasRelief, hasSea, hasHeight } = offer(change) ?? {};
      return [canUncertainty, hasRelief, hasSea, hasHeight];
    };
    expect(shown({ mode: "map" })).toEqual([true, false, false, false]);
    expect(shown({ mode: "volume" })).toEqual([true, false, true, true]);
    expect(shown({ mode: "volume", product: "sea-east" })).toEqual([true, false, false, false]);
    expect(shown({ mode: "map", look: FULL })).toEqual([true, true, true, false]);
    expect(shown({ mode: "flow", product: "sea-east" })).toEqual([false, false, false, false]);
  });

  it("knows of the carbon that accumulated from a product, and takes nothing else for it", () => {
    const lifted = CATALOGUE.products.map((each) => each.product).filter((id) => CATALOGUE.isLifted(id));
    expect(lifted).toEqual(["flux"]);
    expect(CATALOGUE.isLifted("flu")).toBe(false);
  });

  it("offers nothing before there is a product", () => {
    expect(offer({ product: null })).toBeUndefined();
    expect(offer({ product: "gone" })).toBeUndefined();
  });
});
