//! The stream's client against a socket of paper: what is sent and when, which pictures are taken, and how it comes back.
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { type Shot, type Socket, StreamClient } from "../src/stream/client";
import { parsePicture, parseRefused, type Picture } from "../src/stream/picture";
import { Rate } from "../src/stream/rate";

function message(header: object, image: readonly number[] = [1, 2, 3]): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(header));
  const bytes = new Uint8Array(4 + text.length + image.length);
  new DataView(bytes.buffer).setUint32(0, text.length);
  bytes.set(text, 4);
  bytes.set(image, 4 + text.length);
  return bytes.buffer;
}

function header(id: number, kind = "moving"): object {
  return { id, kind, format: "image/jpeg", width: 8, height: 4, view: "/globe/é", time: "2000-07-01T00:00:00Z", took_ms: 14.2 };
}

class PaperSocket implements Socket {
  binaryType = "blob";
  onopen: (() => void) | null = null;
  onmessage: ((event: never) => void) | null = null;
  onclose: (() => void) | null = null;
  readonly sent: unknown[] = [];
  isClosed = false;

  send(text: string): void {
    this.sent.push(JSON.parse(text));
  }

  close(): void {
    this.isClosed = true;
  }

  hear(data: unknown): void {
    this.onmessage?.({ data } as never);
  }
}

class Desk {
  readonly sockets: PaperSocket[] = [];
  readonly shots: Shot<string, string>[] = [];
  readonly dropped: string[] = [];
  readonly refused: number[] = [];
  readonly turns: boolean[] = [];
  frames: (() => void)[] = [];
  nowMs = 0;
  /** Pictures that are being decoded; each ends when its function is called. */
  readonly decoding: (() => void)[] = [];
  isSlow = false;
  readonly client = new StreamClient<string, string>(
    {
      open: () => {
        const socket = new PaperSocket();
        this.sockets.push(socket);
        return socket;
      },
      decode: (picture: Picture) => {
        const image = `${picture.kind} ${picture.id}`;
        if (!this.isSlow) return Promise.resolve(image);
        return new Promise((resolve) => this.decoding.push(() => resolve(image)));
      },
      drop: (image) => this.dropped.push(image),
      frame: (call) => this.frames.push(call),
      nowMs: () => this.nowMs,
    },
    {
      onShot: (shot) => this.shots.push(shot),
      onRefused: ({ status }) => this.refused.push(status),
      onTurn: (isOpen) => this.turns.push(isOpen),
    },
  );

  get socket(): PaperSocket {
    return this.sockets.at(-1) as PaperSocket;
  }

  get images(): string[] {
    return this.shots.map(({ image }) => image);
  }

  frame(): void {
    for (const call of this.frames.splice(0)) call();
  }
}

function opened(): Desk {
  const desk = new Desk();
  desk.client.start();
  desk.socket.onopen?.();
  return desk;
}

const settled = () => vi.advanceTimersByTimeAsync(0);

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

describe("a message", () => {
  it("is a picture with its header", () => {
    const picture = parsePicture(message({ ...header(17, "full"), format: "image/png" }, [9, 8]));
    expect(picture).toMatchObject({ id: 17, kind: "full", format: "image/png", width: 8, height: 4, view: "/globe/é", tookMs: 14.2 });
    expect([...(picture?.bytes ?? [])]).toEqual([9, 8]);
  });

  it("is nothing where it is cut off, longer in words than it is, or of a kind that nobody knows", () => {
    const whole = message(header(1));
    const tooLong = message(header(1));
    new DataView(tooLong).setUint32(0, 1 << 20);
    const wrong = [whole.slice(0, 3), whole.slice(0, 20), tooLong, message(header(1), []), message(header(1, "sketch"))];
    for (const each of [...wrong, message({ ...header(1), id: -1 }), message([])]) expect(parsePicture(each)).toBeUndefined();
  });

  it("of text is an error", () => {
    expect(parseRefused('{"id":17,"error":"too wide","status":400}')).toEqual({ id: 17, error: "too wide", status: 400 });
    for (const nonsense of ["", "[]", "null", '{"id":"17","error":"x"}', '{"seen":1}']) expect(parseRefused(nonsense)).toBeUndefined();
  });
});

describe("states", () => {
  it("are sent at once, and of those within a frame only the newest, with ids that rise", () => {
    const desk = opened();
    for (const address of ["/a", "/b", "/c"]) desk.client.ask(address, address);
    expect(desk.socket.sent).toEqual([{ id: 1, view: "/a" }]);
    desk.frame();
    expect(desk.socket.sent.slice(1)).toEqual([{ id: 2, view: "/c" }]);
  });

  it("are not sent twice, unless their picture is another one now", () => {
    const desk = opened();
    for (let i = 0; i < 3; i++) {
      desk.client.ask("a", "/a");
      desk.frame();
    }
    expect(desk.socket.sent).toHaveLength(1);
    desk.client.forget();
    desk.client.ask("a", "/a");
    expect(desk.socket.sent).toHaveLength(2);
  });

  it("from before the stream opened are sent when it opens, the newest alone", () => {
    const desk = new Desk();
    desk.client.start();
    desk.client.ask("a", "/a");
    desk.client.ask("b", "/b");
    expect(desk.socket.sent).toEqual([]);
    desk.socket.onopen?.();
    expect(desk.socket.sent).toEqual([{ id: 1, view: "/b" }]);
    expect(desk.socket.binaryType).toBe("arraybuffer");
  });
});

describe("pictures", () => {
  function asked(count: number): Desk {
    const desk = opened();
    for (let i = 1; i <= count; i++) {
      desk.nowMs = i * 10;
      desk.client.ask(`scene ${i}`, `/${i}`);
      desk.frame();
    }
    return desk;
  }

  it("come with the scene they were asked for with, and when that was", async () => {
    const desk = asked(2);
    desk.socket.hear(message(header(2)));
    await settled();
    expect(desk.shots).toMatchObject([{ scene: "scene 2", askedMs: 20, image: "moving 2" }]);
    desk.client.seen(2);
    expect(desk.socket.sent.at(-1)).toEqual({ seen: 2 });
  });

  it("that are late are dropped; the full one of a state comes after its moving one", async () => {
    const desk = asked(3);
    for (const [id, kind] of [[2, "moving"], [1, "full"], [2, "moving"], [2, "full"], [2, "moving"], [3, "full"], [3, "moving"], [9, "full"]] as const)
      desk.socket.hear(message(header(id, kind)));
    await settled();
    expect(desk.images).toEqual(["moving 2", "full 2", "full 3"]);
    expect(desk.client.isAnswered).toBe(true);
  });

  it("are behind by as long as the oldest state is waited for that no newer one's picture was shown for", async () => {
    const desk = asked(3);
    desk.nowMs = 100;
    expect(desk.client.lagMs).toBe(90);
    desk.socket.hear(message(header(2)));
    await settled();
    expect(desk.client.lagMs).toBe(70);
    desk.socket.hear(message(header(3)));
    await settled();
    expect(desk.client.lagMs).toBe(0);
  });

  it("that are decoded after a newer one was are dropped", async () => {
    const desk = asked(2);
    desk.isSlow = true;
    desk.socket.hear(message(header(1)));
    desk.socket.hear(message(header(2)));
    desk.decoding[1]?.();
    await settled();
    desk.decoding[0]?.();
    await settled();
    expect(desk.images).toEqual(["moving 2"]);
    expect(desk.client.isAnswered).toBe(false);
    expect(desk.dropped, "what is let go takes no memory").toEqual(["moving 1"]);
  });

  it("that are decoded after the stream ended are let go", async () => {
    const desk = asked(1);
    desk.isSlow = true;
    desk.socket.hear(message(header(1)));
    desk.client.stop();
    desk.decoding[0]?.();
    await settled();
    expect([desk.images, desk.dropped]).toEqual([[], ["moving 1"]]);
  });

  it("that the server refuses are told of, unless something else is asked for by now", () => {
    const desk = asked(2);
    desk.socket.hear('{"id":1,"error":"no such tilt","status":400}');
    expect(desk.refused).toEqual([]);
    desk.socket.hear('{"id":2,"error":"no such tilt","status":400}');
    expect(desk.refused).toEqual([400]);
  });
});

describe("a stream that ends", () => {
  it("comes back after pauses that grow, asks anew for what is wanted, and counts ids on", async () => {
    const desk = opened();
    desk.client.ask("a", "/a");
    const pausesMs: number[] = [];
    for (let i = 0; i < 4; i++) {
      const before = desk.sockets.length;
      desk.socket.onclose?.();
      let waitedMs = 0;
      while (desk.sockets.length === before) {
        await vi.advanceTimersByTimeAsync(10);
        waitedMs += 10;
      }
      pausesMs.push(waitedMs);
      desk.socket.onopen?.();
      desk.frame();
      expect(desk.socket.sent).toEqual([{ id: i + 2, view: "/a" }]);
    }
    pausesMs.forEach((pauseMs, i) => {
      expect(pauseMs).toBeGreaterThanOrEqual(500 * 2 ** i * 0.75 - 10);
      expect(pauseMs).toBeLessThanOrEqual(500 * 2 ** i * 1.25 + 10);
    });
    expect(desk.turns.slice(0, 3)).toEqual([true, false, true]);
  });

  it("was never there is asked for again much later", async () => {
    const desk = new Desk();
    desk.client.start();
    desk.socket.onclose?.();
    expect(desk.turns).toEqual([false]);
    await vi.advanceTimersByTimeAsync(20_000);
    expect(desk.sockets).toHaveLength(1);
    await vi.advanceTimersByTimeAsync(20_000);
    expect(desk.sockets).toHaveLength(2);
  });

  it("by wish stays ended, and what it still sends is not heard", async () => {
    const desk = opened();
    desk.client.ask("a", "/a");
    const { socket } = desk;
    desk.client.stop();
    expect([socket.isClosed, desk.client.isOpen]).toEqual([true, false]);
    socket.hear(message(header(1)));
    socket.onclose?.();
    await vi.advanceTimersByTimeAsync(1_000_000);
    expect([desk.sockets.length, desk.shots.length]).toEqual([1, 0]);
    desk.client.start();
    expect(desk.sockets).toHaveLength(2);
  });
});

describe("the rate", () => {
  it("is of the last seconds, and its latency the middle one", () => {
    const rate = new Rate();
    expect(rate.latencyMs).toBeNaN();
    for (let ms = 0; ms < 1000; ms += 100) rate.add(ms, ms + (ms === 900 ? 5000 : 40));
    expect([rate.at(1100), rate.latencyMs, rate.shown]).toEqual([5, 40, 10]);
    expect(rate.at(20_000)).toBe(0);
  });
});
