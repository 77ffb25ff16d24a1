//! Where tiles are, against answers of paper: what is asked of the server and how often, and the addresses that come of it.
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { LayerSpec } from "../src/globe/layer";
import { TileSources } from "../src/globe/sources";
import { USUAL } from "../src/look/look";

const SPEC: LayerSpec = {
  product: "flux",
  manifest: "flux@1-e9715079",
  revision: 0,
  mode: "map",
  look: USUAL,
  timeIso: "2000-07-16T12:00:00Z",
  bounds: [-180, -90, 180, 90],
};
const EDITION = "a3cc4f8e6f478e6b";
const PINNED = `http://inner:8080/tiles/flux/map/{z}/{x}/{y}.png?time={time}&manifest=flux@1-e9715079&edition=${EDITION}`;

const asked: URL[] = [];
let answer: () => Response;

beforeEach(() => {
  asked.length = 0;
  answer = () => Response.json({ maxzoom: 7, pinned_tiles: [PINNED] });
  vi.stubGlobal("document", { baseURI: "https://proxy.example/ocean/" });
  vi.stubGlobal("fetch", (url: string) => {
    asked.push(new URL(url));
    return Promise.resolve(answer());
  });
});
afterEach(() => void vi.unstubAllGlobals());

describe("the address of tiles", () => {
  it("has the edition, below the page's own path", async () => {
    const { template, maxZoom } = await new TileSources().of(SPEC);
    expect(template).toBe(
      "https://proxy.example/ocean/tiles/flux/map/{z}/{x}/{y}.png" +
        `?time=2000-07-16T12%3A00%3A00Z&manifest=flux%401-e9715079&edition=${EDITION}`,
    );
    expect(maxZoom).toBe(7);
    expect(asked.map((url) => url.pathname + url.search)).toEqual(["/ocean/tiles/flux/map.json?manifest=flux%401-e9715079"]);
  });

  it("has the look that the edition was asked for", async () => {
    const look = { ...USUAL, palette: "viridis", coastlines: true };
    const { template } = await new TileSources().of({ ...SPEC, look });
    expect(asked[0]?.search).toBe("?manifest=flux%401-e9715079&palette=viridis&coastlines=true");
    expect(template).toMatch(new RegExp(`edition=${EDITION}&palette=viridis&coastlines=true$`));
  });

  it("has a number in its place where the server names no edition", async () => {
    answer = () => Response.json({ maxzoom: 7 });
    const { template } = await new TileSources().of({ ...SPEC, revision: 2 });
    expect(template).toMatch(/manifest=flux%401-e9715079&revision=2$/);
  });
});

describe("the server", () => {
  it("is asked once for all instants of a version in a look", async () => {
    const sources = new TileSources();
    await Promise.all(["2000-01-01T00:00:00Z", "2000-02-01T00:00:00Z"].map((timeIso) => sources.of({ ...SPEC, timeIso })));
    expect(asked).toHaveLength(1);
    await sources.of({ ...SPEC, look: { ...USUAL, reversed: true } });
    await sources.of({ ...SPEC, manifest: "flux@2-00000000" });
    await sources.of({ ...SPEC, revision: 1 });
    expect(asked).toHaveLength(4);
  });

  it("is asked again when something is new, or after it did not answer", async () => {
    const sources = new TileSources();
    await sources.of(SPEC);
    sources.forget();
    const isWell = answer;
    answer = () => Response.json({ error: "planted" }, { status: 503 });
    await expect(sources.of(SPEC)).rejects.toThrow("planted");
    answer = isWell;
    await sources.of(SPEC);
    expect(asked).toHaveLength(3);
  });
});
