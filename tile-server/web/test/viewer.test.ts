//! What the page does with news, against lists of paper: what was missed is found, and no list takes the place of a newer one.
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { Product } from "../src/api/types";
import { Inventory } from "../src/state/inventory";
import { INITIAL, Store } from "../src/state/store";
import { type Parts, Viewer } from "../src/viewer";

const STEPS = [{ start: "2000-01-01T00:00:00Z", end: "2000-02-01T00:00:00Z", mid: "2000-01-16T12:00:00Z" }];

function flux(version: number): Product {
  const { start, end } = STEPS[0] as (typeof STEPS)[0];
  const manifest = `flux@${version}-00000000`;
  return { product: "flux", title: "Flux", quantity: "carbon_flux", manifest, modes: ["map"], steps: STEPS, start, end } as Product;
}

/** Answers wait until they are let go, in any order. */
let waiting: ((version: number) => Promise<void>)[] = [];

beforeEach(() => {
  waiting = [];
  vi.stubGlobal("document", { baseURI: "http://host/" });
  vi.stubGlobal("fetch", (url: string) => {
    if (!url.endsWith("/api/products")) return Promise.resolve(Response.json({ palettes: [] }));
    return new Promise<Response>((resolve) =>
      waiting.push(async (version) => {
        resolve(Response.json({ products: [flux(version)] }));
        await new Promise((done) => setTimeout(done, 0));
      }),
    );
  });
});
afterEach(() => void vi.unstubAllGlobals());

describe("a list of products", () => {
  it("does not take the place of one that was asked for after it", async () => {
    const inventory = new Inventory(new Store({ ...INITIAL, product: "flux" }));
    const [first, second, third] = [inventory.load(), inventory.renew(), inventory.renew()];
    await waiting[1]?.(2);
    expect((await second).products).toEqual([]);
    await waiting[0]?.(1);
    await first;
    expect(inventory.product?.manifest).toBe("flux@2-00000000");
    await waiting[2]?.(3);
    expect((await third).products.map((product) => product.manifest)).toEqual(["flux@2-00000000"]);
    expect(inventory.product?.manifest).toBe("flux@3-00000000");
  });
});

describe("a stream of news that is opened anew", () => {
  const told: string[] = [];
  const wanted: string[] = [];

  /** All that the viewer calls does nothing, but for what is watched. */
  function still(watched: Record<string, unknown> = {}): unknown {
    return new Proxy(() => undefined, { get: (_, name) => watched[String(name)] ?? still() });
  }

  async function opened(): Promise<Viewer> {
    told.length = 0;
    wanted.length = 0;
    const store = new Store({ ...INITIAL, product: "flux", timeMs: Date.parse("2000-01-16T12:00:00Z") });
    const inventory = new Inventory(store);
    const loaded = inventory.load();
    await waiting.shift()?.(1);
    await loaded;
    const parts = {
      store,
      inventory,
      notices: still({ tell: (_key: string, text: string) => told.push(text) }),
      presenter: still({ want: (spec: { manifest: string; revision: number }) => wanted.push(`${spec.manifest}+${spec.revision}`) }),
      report: (_key: string, error: unknown) => expect.unreachable(String(error)),
    };
    return new Viewer(still(parts) as Parts, {});
  }

  it("shows the version that was told of while there was none", async () => {
    const viewer = await opened();
    const done = viewer.renew([], true);
    await waiting.shift()?.(2);
    await done;
    expect(told).toEqual(["New data: Flux"]);
    expect(wanted).toEqual(["flux@2-00000000+0"]);
  });

  it("changes nothing where nothing was missed", async () => {
    const viewer = await opened();
    const done = viewer.renew([], true);
    await waiting.shift()?.(1);
    await done;
    expect([told, wanted]).toEqual([[], []]);
  });

  it("tells once what came with it", async () => {
    const viewer = await opened();
    const touched = [{ start: "2000-01-01T00:00:00Z", end: "2000-02-01T00:00:00Z" }];
    const done = viewer.renew([{ product: "flux", manifest: "flux@2-00000000", touched }], true);
    await waiting.shift()?.(2);
    await done;
    expect(told).toEqual(["New data: Flux"]);
    expect(wanted).toEqual(["flux@2-00000000+0"]);
  });

  it("is not needed for a version that is told again, whose pictures are asked for anew", async () => {
    const viewer = await opened();
    const touched = [{ start: "2000-01-01T00:00:00Z", end: "2000-02-01T00:00:00Z" }];
    const done = viewer.renew([{ product: "flux", manifest: "flux@1-00000000", touched }], false);
    await waiting.shift()?.(1);
    await done;
    expect(wanted).toEqual(["flux@1-00000000+1"]);
  });
});
