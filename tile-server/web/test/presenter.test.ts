//! Which layer loads next, against a stage of paper: what is loaded, called off and shown while wishes come faster than pictures.
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { LayerSpec } from "../src/globe/layer";
import { Presenter } from "../src/globe/presenter";
import type { LayerStage, Prepared } from "../src/globe/stage";
import { USUAL } from "../src/look/look";

function at(hour: number, product = "flux"): LayerSpec {
  const timeIso = `2000-01-01T${String(hour).padStart(2, "0")}:00:00Z`;
  return { product, manifest: "m-1", revision: 0, mode: "map", look: USUAL, timeIso, bounds: [-180, -90, 180, 90] };
}

/** Layers are there when they are told so. */
class PaperStage {
  shown: string | undefined;
  readonly told: string[] = [];
  readonly #loads: { spec: LayerSpec; end: (isLoaded: boolean) => void }[] = [];

  prepare(spec: LayerSpec, signal: AbortSignal): Promise<Prepared | null> {
    this.told.push(`load ${hourOf(spec)}`);
    return new Promise((resolve) => {
      const end = (isLoaded: boolean): void => resolve(isLoaded ? ({ spec } as Prepared) : null);
      signal.addEventListener("abort", () => {
        this.told.push(`call off ${hourOf(spec)}`);
        end(false);
      });
      this.#loads.push({ spec, end });
    });
  }

  reveal({ spec }: Prepared): void {
    this.told.push(`show ${hourOf(spec)}`);
    this.shown = spec.timeIso;
  }

  discard(): void {}
  clear(): void {}

  hasWhole(key: string): boolean {
    return this.shown !== undefined && key.endsWith(this.shown);
  }

  async ends(hour: number): Promise<void> {
    this.#loads.filter(({ spec }) => hourOf(spec) === hour).at(-1)?.end(true);
    await vi.advanceTimersByTimeAsync(0);
  }
}

function hourOf({ timeIso }: LayerSpec): number {
  return Number(timeIso.slice(11, 13));
}

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

describe("wishes", () => {
  function staged(): [PaperStage, Presenter] {
    const stage = new PaperStage();
    return [stage, new Presenter(stage as unknown as LayerStage)];
  }

  it("that come while one loads are passed by, but for the last", async () => {
    const [stage, presenter] = staged();
    for (const hour of [1, 2, 3, 4]) presenter.want(at(hour));
    await stage.ends(1);
    await stage.ends(4);
    expect(stage.told).toEqual(["load 1", "show 1", "load 4", "show 4"]);
  });

  it("that rest call off what is on its way of an instant that was passed by", async () => {
    const [stage, presenter] = staged();
    presenter.want(at(1));
    for (const hour of [2, 3, 4]) {
      await vi.advanceTimersByTimeAsync(100);
      presenter.want(at(hour));
    }
    expect(stage.told).toEqual(["load 1"]);
    await vi.advanceTimersByTimeAsync(300);
    await stage.ends(4);
    expect(stage.told).toEqual(["load 1", "call off 1", "load 4", "show 4"]);
  });

  it("of a slow hand are shown by the way, too", async () => {
    const [stage, presenter] = staged();
    for (const hour of [1, 2, 3, 4, 5, 6]) {
      presenter.want(at(hour));
      await vi.advanceTimersByTimeAsync(400);
    }
    await stage.ends(2);
    expect(stage.told).toEqual(["load 1", "call off 1", "load 2", "show 2", "load 6"]);
  });

  it("that come back to what is on its way call nothing off", async () => {
    const [stage, presenter] = staged();
    for (const hour of [1, 2, 1]) presenter.want(at(hour));
    await vi.advanceTimersByTimeAsync(1000);
    await stage.ends(1);
    expect(stage.told).toEqual(["load 1", "show 1"]);
  });

  it("of another product end what loads at once", async () => {
    const [stage, presenter] = staged();
    presenter.want(at(1));
    presenter.want(at(2, "wind"));
    await stage.ends(2);
    expect(stage.told).toEqual(["load 1", "call off 1", "load 2", "show 2"]);
  });

  it("take the place of what playback loads ahead, even of the same instant", async () => {
    const [stage, presenter] = staged();
    const ahead = presenter.preload(at(1));
    await vi.advanceTimersByTimeAsync(0);
    presenter.want(at(1));
    expect(await ahead).toBeNull();
    await stage.ends(1);
    expect(stage.told).toEqual(["load 1", "call off 1", "load 1", "show 1"]);
  });

  it("wait while pictures lie over the globe", async () => {
    const [stage, presenter] = staged();
    presenter.isHeld = true;
    for (const hour of [1, 2]) presenter.want(at(hour));
    expect(stage.told).toEqual([]);
    presenter.isHeld = false;
    expect(stage.told).toEqual(["load 2"]);
  });
});
