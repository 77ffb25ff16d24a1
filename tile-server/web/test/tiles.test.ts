//! Tiles of a layer against a server of paper: what is asked, when it is asked again, and who is told of what.
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Request, RequestType, Resource } from "cesium";
import { MOST_TIMES, type TileFailure } from "../src/api/again";
import type { LayerSpec } from "../src/globe/layer";
import { LayerTiles, TileCounts } from "../src/globe/tiles";
import { USUAL } from "../src/look/look";

// Cesium looks for it once, when it is loaded.
vi.hoisted(() => vi.stubGlobal("XMLHttpRequest", class {}));

const SPEC: LayerSpec = {
  product: "flux",
  manifest: "flux@1-e9715079",
  revision: 0,
  mode: "map",
  look: USUAL,
  timeIso: "2000-07-16T12:00:00Z",
  bounds: [-180, -90, 180, 90],
};
const SOURCE = { template: "https://tiles.example/{z}/{x}/{y}.png?time=1", maxZoom: 3 };
const BUSY = { status: 503, headers: "Retry-After: 2\r\n", body: '{"error":"planted: too much to do"}' };
const WELL = { status: 200, headers: "", body: "a picture" };

interface PaperAnswer {
  status: number;
  headers: string;
  body: string;
}

/** When each question came, ms. */
const asked: number[] = [];
let answers: PaperAnswer[] = [];

/** As much of the browser's own as Cesium uses to load a picture. */
class PaperXhr {
  status = 0;
  response: Blob | undefined;
  responseType = "";
  onload: () => void = () => undefined;
  onerror: () => void = () => undefined;
  #headers = "";

  open(): void {}
  setRequestHeader(): void {}
  abort(): void {}
  getAllResponseHeaders(): string {
    return this.#headers;
  }

  send(): void {
    asked.push(Date.now());
    const answer = answers.shift() ?? WELL;
    setTimeout(() => {
      this.status = answer.status;
      this.#headers = answer.headers;
      this.response = new Blob([answer.body]);
      this.onload();
    }, 10);
  }
}

beforeEach(() => {
  vi.useFakeTimers();
  asked.length = 0;
  answers = [];
  vi.stubGlobal("document", { createElement: () => ({}) });
  vi.stubGlobal("window", { location: { href: "https://tiles.example/" } });
  // It draws two pictures to find out, which nothing here could.
  vi.spyOn(Resource as unknown as { supportsImageBitmapOptions: () => Promise<boolean> }, "supportsImageBitmapOptions").mockResolvedValue(true);
  vi.stubGlobal("XMLHttpRequest", PaperXhr);
  vi.stubGlobal("createImageBitmap", () => Promise.resolve({ width: 2, height: 2, close: () => undefined }));
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
  vi.restoreAllMocks();
});

interface Layer {
  tiles: LayerTiles;
  counts: TileCounts;
  failures: TileFailure[];
  /** Asks for a tile as Cesium does. */
  ask(): Promise<unknown>;
}

function layer(): Layer {
  const counts = new TileCounts();
  const failures: TileFailure[] = [];
  const tiles = new LayerTiles(SPEC, SOURCE, counts, (failure) => failures.push(failure));
  const ask = (): Promise<unknown> => {
    const request = new Request({ throttle: false, throttleByServer: true, type: RequestType.IMAGERY });
    return Promise.resolve(tiles.provider.requestImage(1, 0, 2, request)).catch((error: unknown) => {
      tiles.provider.errorEvent.raiseEvent({ x: 1, y: 0, level: 2, error });
    });
  };
  return { tiles, counts, failures, ask };
}

describe("a tile that a busy server refuses", () => {
  it("is asked for again when the server says, and not before", async () => {
    answers = [BUSY, WELL];
    const { tiles, counts, failures, ask } = layer();
    const loading = ask();
    await vi.advanceTimersByTimeAsync(1999);
    expect(asked).toHaveLength(1);
    expect([tiles.pending, counts.pending, counts.failed]).toEqual([1, 1, 0]);
    await vi.advanceTimersByTimeAsync(1100);
    await loading;
    expect(asked).toHaveLength(2);
    expect([tiles.pending, counts.loaded, counts.failed]).toEqual([0, 1, 0]);
    expect(failures).toEqual([]);
  });

  it("is given up after some times, and told of in the server's words without another question", async () => {
    answers = Array.from({ length: 50 }, () => BUSY);
    const { counts, failures, ask } = layer();
    const loading = ask();
    await vi.advanceTimersByTimeAsync(10 * 60_000);
    await loading;
    expect(asked).toHaveLength(1 + MOST_TIMES);
    const pauses = asked.slice(1).map((at, index) => at - (asked[index] ?? 0));
    pauses.forEach((pause, index) => expect(pause).toBeGreaterThanOrEqual(Math.min(2000 * 2 ** index, 30_000)));
    expect(counts.failed).toBe(1);
    expect(failures).toMatchObject([{ status: 503, url: "https://tiles.example/2/1/0.png?time=1" }]);
    expect(await failures[0]?.reason).toBe("planted: too much to do");
  });

  it("is not asked for again when its layer is gone, and nobody is told", async () => {
    answers = [BUSY];
    const { tiles, counts, failures, ask } = layer();
    const loading = ask();
    await vi.advanceTimersByTimeAsync(500);
    tiles.cancel();
    await vi.advanceTimersByTimeAsync(60_000);
    await loading;
    expect(asked).toHaveLength(1);
    expect([counts.pending, counts.failed, tiles.isLost]).toEqual([0, 0, false]);
    expect(failures).toEqual([]);
  });
});

describe("a tile that fails otherwise", () => {
  it("is told of at once", async () => {
    answers = [{ status: 500, headers: "", body: "" }];
    const { counts, failures, ask } = layer();
    const loading = ask();
    await vi.advanceTimersByTimeAsync(100);
    await loading;
    expect(asked).toHaveLength(1);
    expect(counts.failed).toBe(1);
    expect(failures).toEqual([{ status: 500, url: "https://tiles.example/2/1/0.png?time=1", reason: undefined }]);
  });
});
