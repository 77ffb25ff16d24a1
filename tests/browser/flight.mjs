//! A page of its own for steps that fly, and what its live picture shows.
import { request } from "node:http";
import { Journey, LIMIT_MS } from "./journey.mjs";

export const NO_STREAM = "this server has no stream";
/** A page of its own: what flies must not change what the other steps look at. */
export async function flown(journey, hash, act, prepare = async () => {}) {
  const page = await journey.page.context().newPage();
  page.setDefaultTimeout(LIMIT_MS);
  // A processor draws full pictures of this size in seconds.
  await page.setViewportSize({ width: 800, height: 500 });
  try {
    await prepare(page);
    await page.goto(new URL(hash, journey.base).href);
    await page.waitForFunction(() => window.fluxglobe?.ready === true, undefined, { timeout: LIMIT_MS });
    await act(new Journey(page, journey.watch, journey.base));
  } finally {
    await page.close();
  }
}

/** Asked without a browser, which would write a refusal down as an error of the page. */
export function hasStream(base) {
  const headers = {
    connection: "Upgrade",
    upgrade: "websocket",
    "sec-websocket-version": "13",
    "sec-websocket-key": "Zmx1eGdsb2JlIGZseWluZw==",
  };
  return new Promise((resolve, reject) => {
    const asked = request(new URL("stream", base), { headers });
    asked.on("upgrade", (_answer, socket) => {
      socket.destroy();
      resolve(true);
    });
    asked.on("response", (answer) => {
      answer.resume();
      resolve(false);
    });
    asked.on("error", reject);
    asked.end();
  });
}

export const picture = (journey) => journey.page.evaluate(() => window.fluxglobe.picture);
export const query = ({ view }) => Object.fromEntries(new URL(view, "http://server").searchParams);
/** The full picture of what the page shows now. */
export const rests = (journey) =>
  journey.until(() => {
    const { picture, state } = window.fluxglobe;
    const time = `${new Date(state.timeMs).toISOString().slice(0, 19)}Z`;
    const asked = picture && new URL(picture.view, location.href).searchParams;
    return picture?.kind === "full" && asked.get("time") === time && Math.abs(asked.get("lon") - state.camera.lon) < 0.01;
  });
