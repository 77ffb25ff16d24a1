//! When a busy server is asked again: its header and the clock in, a pause out, and what becomes of it when nobody waits any more.
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { askedAgain, MOST_TIMES, pauseMs, waited } from "../src/api/again";
import { getPicture } from "../src/api/client";

const NOW_MS = Date.UTC(2026, 0, 2, 3, 4, 5);

function pause(retryAfter: string | undefined, times = 0, chance = 0): number | undefined {
  return pauseMs(retryAfter, times, NOW_MS, chance);
}

describe("a pause", () => {
  it("is what the server says at least, in seconds or as a date", () => {
    expect(pause("1")).toBe(1000);
    expect(pause(" 30 ")).toBe(30_000);
    expect(pause("Fri, 02 Jan 2026 03:04:12 GMT")).toBe(7000);
  });

  it("is never none, even if the server says so", () => {
    expect(pause("0")).toBe(250);
    expect(pause("Fri, 02 Jan 2026 03:04:00 GMT")).toBe(250);
  });

  it("is longer by up to a half by chance, and never shorter", () => {
    expect(pause("4", 0, 0.5)).toBe(5000);
    for (let index = 0; index < 200; index += 1) {
      const own = pauseMs("4", 0) ?? 0;
      expect(own >= 4000 && own <= 6000).toBe(true);
    }
  });

  it("grows with every time that was in vain, until nobody would wait for it", () => {
    const all = Array.from({ length: MOST_TIMES }, (_, times) => pause("1", times));
    expect(all).toEqual([1000, 2000, 4000, 8000, 16_000]);
    expect(pause("20", 1)).toBe(30_000);
  });

  it("is none where the server names no time, or a later one than anybody waits for", () => {
    for (const text of [undefined, "", "soon", "-1", "31", "86400", "Fri, 02 Jan 2027 03:04:05 GMT"])
      expect(pause(text)).toBeUndefined();
  });
});

describe("waiting", () => {
  beforeEach(() => void vi.useFakeTimers());
  afterEach(() => void vi.useRealTimers());

  it("is over after the pause and not before", async () => {
    const seen = vi.fn();
    void waited(1000, new AbortController().signal).then(seen);
    await vi.advanceTimersByTimeAsync(999);
    expect(seen).not.toHaveBeenCalled();
    await vi.advanceTimersByTimeAsync(1);
    expect(seen).toHaveBeenCalledWith(true);
  });

  it("ends at once when nobody wants it any more", async () => {
    const gone = new AbortController();
    const waiting = waited(1000, gone.signal);
    gone.abort();
    expect(await waiting).toBe(false);
    expect(await waited(1000, gone.signal)).toBe(false);
    expect(vi.getTimerCount()).toBe(0);
  });
});

describe("a picture that others wait for", () => {
  beforeEach(() => void vi.useFakeTimers());
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  /** A server that refuses so many times. */
  function refusing(count: number, headers: Record<string, string>): { asked: () => number } {
    let asked = 0;
    vi.stubGlobal("fetch", () => {
      asked += 1;
      const isRefused = asked <= count;
      return Promise.resolve(
        isRefused ? Response.json({ error: "planted: too much to do" }, { status: 503, headers }) : new Response("picture"),
      );
    });
    return { asked: () => asked };
  }

  const ask = (signal: AbortSignal) => askedAgain(() => getPicture("http://host/globe", signal), signal);

  it("is asked for again when the server says, and comes", async () => {
    const server = refusing(2, { "Retry-After": "1" });
    const come = ask(new AbortController().signal);
    await vi.advanceTimersByTimeAsync(999);
    expect(server.asked()).toBe(1);
    await vi.advanceTimersByTimeAsync(10_000);
    expect(await (await come).text()).toBe("picture");
    expect(server.asked()).toBe(3);
  });

  it("fails where the server refuses for good, or as often as a tile would be", async () => {
    const once = refusing(1, {});
    await expect(ask(new AbortController().signal)).rejects.toThrow("too much to do");
    expect(once.asked()).toBe(1);
    const always = refusing(Number.POSITIVE_INFINITY, { "Retry-After": "1" });
    const failed = expect(ask(new AbortController().signal)).rejects.toThrow("too much to do");
    await vi.advanceTimersByTimeAsync(300_000);
    await failed;
    expect(always.asked()).toBe(1 + MOST_TIMES);
  });

  it("is waited for no longer when nobody wants it", async () => {
    const server = refusing(Number.POSITIVE_INFINITY, { "Retry-After": "5" });
    const gone = new AbortController();
    const failed = expect(ask(gone.signal)).rejects.toThrow("too much to do");
    await vi.advanceTimersByTimeAsync(0);
    gone.abort();
    await failed;
    expect(server.asked()).toBe(1);
  });
});
