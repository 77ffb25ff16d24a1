//! Observations and news: pure parts of what the page makes of them.
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { countText, series, seriesUrl } from "../src/api/observations";
import { tileTemplate } from "../src/api/pictures";
import type { News, Observation, Platform } from "../src/api/types";
import { parseNews, type Stream, touches, Updates } from "../src/api/updates";
import { denseLine } from "../src/globe/box";
import { groupsOf, isTrusted, qualityText } from "../src/panels/measured";
import { Catalogue } from "../src/state/catalogue";
import { decodeHash, encodeHash } from "../src/state/hash";
import { INITIAL } from "../src/state/store";

beforeEach(() => vi.stubGlobal("document", { baseURI: "http://host/below/" }));
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

function measured(change: Partial<Observation>): Observation {
  const base = { dataset: "d", platform: "p", time: "2020-01-01T00:00:00Z", lon_deg: 1, lat_deg: 2, depth_m: 1 };
  const usual = { kind: "buoy", property: "sea_temperature", value: 20, unit: "degC", quality: "good" } as const;
  return { ...base, ...usual, ...change };
}

describe("what a platform measured", () => {
  it("is one group for each property and depth, in the order of time, the fullest first", () => {
    const groups = groupsOf("buoy", [
      measured({ property: "wind_speed", unit: "m s-1" }),
      measured({ time: "2020-01-02T00:00:00Z", value: 21 }),
      measured({}),
      measured({ depth_m: 10, value: 15 }),
    ]);
    expect(groups.map((group) => [group.title, group.unit, group.points.map((point) => point.value)])).toEqual([
      ["sea temperature, 1 m", "degC", [20, 21]],
      ["sea temperature, 10 m", "degC", [15]],
      ["wind speed", "m s-1", [20]],
    ]);
    expect(groups[0]?.over).toBe("time");
    expect(groups[0]?.points[0]?.x).toBe(Date.parse("2020-01-01T00:00:00Z"));
  });

  it("of a cast is plotted over depth", () => {
    const [group, ...others] = groupsOf("profile", [measured({ depth_m: 50 }), measured({ depth_m: 5 })]);
    expect(others).toEqual([]);
    expect(group?.over).toBe("depth");
    expect(group?.title).toBe("sea temperature");
    expect(group?.points.map((point) => point.x)).toEqual([5, 50]);
  });

  it("in two units is never one line", () => {
    expect(groupsOf("buoy", [measured({}), measured({ unit: "K", value: 293 })])).toHaveLength(2);
  });

  it("says how far it may be trusted", () => {
    const points = groupsOf("ship", [
      measured({ quality: "bad" }),
      measured({}),
      measured({}),
      measured({ quality: "not_evaluated" }),
    ])[0]?.points;
    expect(qualityText(points ?? [])).toBe("2 good, 1 not evaluated, 1 bad");
    expect(points?.filter((point) => isTrusted(point.quality))).toHaveLength(3);
  });
});

describe("platforms", () => {
  it("are counted by kind", () => {
    const of = (kind: string): Platform => ({ properties: { kind } }) as Platform;
    expect(countText([of("ship"), of("buoy"), of("buoy")])).toBe("2 buoys, 1 ship");
    expect(countText([])).toBe("none here");
  });

  it("may have any name in an address", () => {
    expect(seriesUrl("buoys", "A/B é?")).toBe("http://host/below/api/observations/buoys/A%2FB%20%C3%A9%3F");
  });

  it("have tracks whose lines stay above the ground", () => {
    const dense = denseLine(
      [
        [0, 0],
        [10, 2],
        [11, 2],
      ],
      4,
    );
    expect(dense).toHaveLength(5);
    expect(dense[0]).toEqual([0, 0]);
    expect(dense[3]).toEqual([10, 2]);
    expect(dense[1]?.[0]).toBeCloseTo(10 / 3);
    expect(denseLine([], 4)).toEqual([]);
  });

  it("are read page by page, and not without end", async () => {
    const asked: string[] = [];
    vi.stubGlobal("fetch", (url: string) => {
      asked.push(new URL(url).searchParams.get("after") ?? "");
      const next = asked.length < 3 ? String(asked.length) : null;
      return Promise.resolve(new Response(JSON.stringify({ observations: [measured({})], next })));
    });
    const answer = await series("d", "p", new AbortController().signal);
    expect(asked).toEqual(["", "1", "2"]);
    expect(answer.observations).toHaveLength(3);
    expect(answer.next).toBeNull();
    vi.stubGlobal("fetch", () => Promise.resolve(new Response(JSON.stringify({ observations: [measured({})], next: "x" }))));
    const endless = await series("d", "p", new AbortController().signal);
    expect(endless.observations).toHaveLength(5);
    expect(endless.next).toBe("x");
  });

  it("are in a shared address", () => {
    expect(decodeHash(encodeHash({ ...INITIAL, observations: true }))).toMatchObject({ observations: true });
    expect(decodeHash("#observations=maybe")).toEqual({});
    expect(encodeHash({ ...INITIAL, tab: "platform" })).not.toContain("tab=");
  });
});

describe("news", () => {
  const news: News = {
    product: "flux",
    manifest: "flux@2-00000000",
    touched: [{ start: "2000-02-01T00:00:00Z", end: "2000-03-01T00:00:00Z" }],
  };

  it("touch the pictures of their periods only", () => {
    const at = (text: string) => touches(news, Date.parse(text));
    expect([at("2000-01-31"), at("2000-02-01"), at("2000-02-20"), at("2000-03-02")]).toEqual([
      false,
      true,
      true,
      false,
    ]);
    expect(touches(news, Number.NaN)).toBe(false);
  });

  it("that are none are passed over", () => {
    expect(parseNews(JSON.stringify(news))).toEqual(news);
    for (const text of ["", "null", "3", "{}", '{"product":"p"}']) expect(parseNews(text), text).toBeUndefined();
  });

  class Fake implements Stream {
    static readonly all: Fake[] = [];
    readyState = 1;
    readonly #listeners: [string, (event: MessageEvent<string>) => void][] = [];

    constructor(readonly url: string) {
      Fake.all.push(this);
    }

    addEventListener(type: string, listener: (event: MessageEvent<string>) => void): void {
      this.#listeners.push([type, listener]);
    }

    close(): void {
      this.readyState = 2;
    }

    say(type: string, data = ""): void {
      for (const [wanted, listener] of this.#listeners) if (wanted === type) listener({ data } as MessageEvent<string>);
    }
  }

  it("come in bundles, and again after a refusal", () => {
    vi.useFakeTimers();
    Fake.all.length = 0;
    const told: News[][] = [];
    new Updates(
      (bundle) => told.push(bundle),
      (url) => new Fake(url),
    );
    expect(Fake.all.map((stream) => stream.url)).toEqual(["http://host/below/api/events"]);
    Fake.all[0]?.say("product", JSON.stringify(news));
    Fake.all[0]?.say("product", "nonsense");
    Fake.all[0]?.say("product", JSON.stringify({ ...news, product: "sst" }));
    expect(told).toEqual([]);
    vi.advanceTimersByTime(1_000);
    expect(told.map((bundle) => bundle.map((one) => one.product))).toEqual([["flux", "sst"]]);
    Fake.all[0]?.say("error");
    vi.advanceTimersByTime(60_000);
    expect(Fake.all, "the browser itself comes back").toHaveLength(1);
    Fake.all[0]?.close();
    Fake.all[0]?.say("error");
    vi.advanceTimersByTime(60_000);
    expect(Fake.all).toHaveLength(2);
    Fake.all[1]?.say("product", JSON.stringify(news));
    vi.advanceTimersByTime(1_000);
    expect(told).toHaveLength(2);
  });

  it("say of every stream that it is new, for what was told before it may be lost", () => {
    vi.useFakeTimers();
    Fake.all.length = 0;
    const told: [count: number, isAnew: boolean][] = [];
    new Updates(
      (bundle, isAnew) => told.push([bundle.length, isAnew]),
      (url) => new Fake(url),
    );
    Fake.all[0]?.say("open");
    vi.advanceTimersByTime(1_000);
    Fake.all[0]?.say("product", JSON.stringify(news));
    vi.advanceTimersByTime(1_000);
    // A refusal ends the stream; what the browser brings back by itself opens again, too.
    Fake.all[0]?.close();
    Fake.all[0]?.say("error");
    vi.advanceTimersByTime(60_000);
    expect(told).toEqual([
      [0, true],
      [1, false],
    ]);
    Fake.all[1]?.say("open");
    Fake.all[1]?.say("product", JSON.stringify(news));
    vi.advanceTimersByTime(1_000);
    expect(told.slice(2)).toEqual([[1, true]]);
  });

  it("make other addresses of tiles and keep what was learnt", () => {
    const address = (manifest: string, revision: number) =>
      tileTemplate("flux", "map", "2000-01-01T00:00:00Z", { manifest, revision });
    expect(address("flux@1-00000000", 0)).toContain(".png?time=2000-01-01T00%3A00%3A00Z&manifest=flux%401-00000000");
    expect(new Set([address("a", 0), address("b", 0), address("a", 1)]).size).toBe(3);
    const product = { product: "flux", manifest: "a", bounds_deg: [0, 0, 1, 1], steps: [] } as never;
    const before = new Catalogue([product]);
    before.revise("flux");
    const layer = new Catalogue([product], before).layerAt({ ...INITIAL, product: "flux" }, 0);
    expect(layer?.revision).toBe(1);
  });
});
