//! What the page says of tiles and layers that did not come, what ends with them, and whether the server is asked why.
import { afterEach, beforeEach, expect, it, vi } from "vitest";
import { Connection } from "../src/page/connection";
import type { Notices } from "../src/page/notices";

const url = "https://tiles.example/2/1/0.png";
const shown: string[] = [];
const asked: string[] = [];

beforeEach(() => {
  shown.length = 0;
  asked.length = 0;
  vi.stubGlobal("fetch", (address: string) => {
    asked.push(address);
    return Promise.resolve(Response.json({ error: "planted: broken" }, { status: 500 }));
  });
});
afterEach(() => void vi.unstubAllGlobals());

function connection(onTrouble: () => void = () => undefined): Connection {
  const notices = { show: (_key: string, text: string) => shown.push(text), clear: () => undefined };
  return new Connection(
    notices as unknown as Notices,
    onTrouble,
    () => undefined,
  );
}

it("a server that wants to be left alone for a while is not asked why", async () => {
  await connection().tileFailed({ status: 503, url, reason: Promise.resolve("planted: too much to do") });
  expect(shown).toEqual(["Pictures are missing: planted: too much to do"]);
  expect(asked).toEqual([]);
});

it("any other is asked, for a picture's failure carries no reason", async () => {
  await connection().tileFailed({ status: 500, url, reason: undefined });
  expect(shown).toEqual(["Pictures are missing: planted: broken"]);
  expect(asked).toEqual([url]);
});

it("a layer that is refused ends playing, as failing tiles do", async () => {
  const trouble = vi.fn();
  connection(trouble).layerRefused(new Error("planted: no such look"));
  expect(trouble).toHaveBeenCalledOnce();
  expect(shown).toEqual(["planted: no such look"]);
  await connection(trouble).tileFailed({ status: 500, url, reason: undefined });
  expect(trouble).toHaveBeenCalledTimes(2);
});
