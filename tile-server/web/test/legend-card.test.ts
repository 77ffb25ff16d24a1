//! Which legend the card shows, against answers of paper: a version's own, however often the product has newer ones.
import { afterEach, beforeEach, expect, it, vi } from "vitest";
import type { Legend } from "../src/api/types";
import { codesView, colourOf } from "../src/look/codes";
import { type Coloured, LegendCard } from "../src/look/legend-card";
import { USUAL } from "../src/look/look";
import { paperDocument, PaperElement } from "./paper-page";

function legend(high: number): Legend {
  return { low: 0, high, unit: "mg m-3", label: "Chlorophyll", stops: [], ticks: [0, high] };
}

const asked: string[] = [];

beforeEach(() => {
  asked.length = 0;
  vi.stubGlobal("document", paperDocument());
  vi.stubGlobal("fetch", (url: string) => {
    asked.push(new URL(url).pathname + new URL(url).search);
    return Promise.resolve(Response.json(legend(7)));
  });
});
afterEach(() => void vi.unstubAllGlobals());

function layer(manifest: string): Coloured {
  return { product: "chl", manifest, mode: "map", look: USUAL };
}

it("the legend follows the version in sight, whose values may have another range", async () => {
  const usual = new Map([["chl@1-00000000", legend(3)]]);
  const slot = new PaperElement();
  const card = new LegendCard(
    slot as unknown as HTMLElement,
    (_product, _mode, manifest) => usual.get(manifest),
    () => [],
    (_key, error) => expect.unreachable(String(error)),
  );
  await card.show(layer("chl@1-00000000"));
  expect(slot.text).toMatch(/ 0 3$/);
  usual.clear();
  usual.set("chl@2-00000000", legend(5));
  await card.show(layer("chl@2-00000000"));
  expect(slot.text).toMatch(/ 0 5$/);
  expect(asked).toEqual([]);
  // One that is not the newest any more is asked for by its name, and once.
  await card.show(layer("chl@1-00000000"));
  await card.show(layer("chl@2-00000000"));
  await card.show(layer("chl@1-00000000"));
  expect(slot.text).toMatch(/ 0 7$/);
  expect(asked).toEqual(["/api/products/chl/legend.json?manifest=chl%401-00000000"]);
});

it("colours that were chosen are those of a version too", async () => {
  const slot = new PaperElement();
  const card = new LegendCard(
    slot as unknown as HTMLElement,
    () => legend(3),
    () => [],
    (_key, error) => expect.unreachable(String(error)),
  );
  const look = { ...USUAL, palette: "ice" };
  await card.show({ ...layer("chl@1-00000000"), look });
  await card.show({ ...layer("chl@2-00000000"), look });
  expect(asked.map((url) => url.replace(/^.*\?/, ""))).toEqual([
    "manifest=chl%401-00000000&palette=ice",
    "manifest=chl%402-00000000&palette=ice",
  ]);
});

const CODES = [
  { value: 1, meaning: "open_ocean" },
  { value: 2, meaning: "land" },
  { value: 5, meaning: "ice" },
];

it("a mask has a swatch a code with its meaning, and no bar", async () => {
  const slot = new PaperElement();
  const card = new LegendCard(
    slot as unknown as HTMLElement,
    () => legend(5),
    (product) => (product === "chl" ? CODES : []),
    (_key, error) => expect.unreachable(String(error)),
  );
  await card.show(layer("chl@1-00000000"));
  expect(slot.text.replace(/\s+/g, " ")).toBe("Chlorophyll 1 open ocean 2 land 5 ice");
  // Trails are coloured by their speed.
  await card.show({ ...layer("chl@1-00000000"), mode: "flow" });
  expect(slot.text).toMatch(/ 0 5$/);
});

it("swatches have the colours that pictures have", () => {
  const grey = { ...legend(10), stops: [[0, "#000000"], [0.5, "#806040"], [1, "#ffffff"]] as [number, string][] };
  expect(colourOf(grey, 0)).toBe("rgb(0, 0, 0)");
  expect(colourOf(grey, 10)).toBe("rgb(255, 255, 255)");
  // Pictures have 256 colours: the middle is the 128th of 255 steps, not the stop itself.
  expect(colourOf(grey, 5)).toBe("rgb(128, 97, 65)");
  expect(colourOf(grey, 2.5)).toBe("rgb(64, 48, 32)");
  // What lies beyond the range has the colour of its end.
  expect([colourOf(grey, -3), colourOf(grey, 99)]).toEqual(["rgb(0, 0, 0)", "rgb(255, 255, 255)"]);
  expect(colourOf({ ...grey, low: 1, scale: "log" }, 0)).toBe("rgb(0, 0, 0)");
  expect(colourOf({ ...grey, low: 1, scale: "log" }, -1)).toBe("rgb(0, 0, 0)");
  const view = codesView(grey, CODES) as unknown as PaperElement;
  const [, list] = view.children as PaperElement[];
  const swatches = list?.children.map((line) => ((line as PaperElement).children[0] as PaperElement).style["background"]);
  expect(swatches).toEqual(CODES.map(({ value }) => colourOf(grey, value)));
});
