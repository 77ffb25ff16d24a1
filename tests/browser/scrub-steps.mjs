//! Steps that drag time: no moment without a picture, none older after a newer one, and nothing waited for that was passed by.
import assert from "node:assert/strict";
import { Film } from "./film.mjs";
import { flown, hasStream, NO_STREAM, picture, rests } from "./flight.mjs";
import { eventually, iso } from "./reading.mjs";

const SLOW_MS = 900;
const NEVER_MS = 120_000;

async function thumb(page) {
  const box = await page.locator("#time").boundingBox();
  // The thumb's own width is not part of the way.
  const at = (part) => [box.x + 8 + (box.width - 16) * part, box.y + box.height / 2];
  return { to: (part) => page.mouse.move(...at(part)), down: () => page.mouse.down(), up: () => page.mouse.up() };
}

/** Drags from one part of the record to another, as fast as a hand does. */
async function drag({ page, hand }, from, to, steps, pauseMs) {
  for (let i = 0; i <= steps; i++) {
    await hand.to(from + ((to - from) * i) / steps);
    await page.waitForTimeout(pauseMs);
  }
}

/** A tile of one colour, which tells where in the record its instant lies: from blue to red, and nothing of green. */
function colouredTile(part) {
  const red = Math.round(40 + 200 * part);
  const pixels = 16;
  const bytes = Buffer.alloc(54 + 3 * pixels);
  bytes.write("BM");
  bytes.writeUInt32LE(bytes.length, 2);
  bytes.writeUInt32LE(54, 10);
  bytes.writeUInt32LE(40, 14);
  bytes.writeInt32LE(4, 18);
  bytes.writeInt32LE(4, 22);
  bytes.writeUInt16LE(1, 26);
  bytes.writeUInt16LE(24, 28);
  for (let i = 0; i < pixels; i++) bytes.set([280 - red, 0, red], 54 + 3 * i);
  return bytes;
}

/**
 * What the middle of the window shows, over which nothing lies: the least and the largest part of the record, and how far its
 * colours are from those of tiles.
 */
function partsIn(image) {
  const [left, top, size] = [360, 180, 60];
  let [least, largest, off] = [1, 0, 0];
  for (let y = top; y < top + size; y++) {
    for (let x = left; x < left + size; x++) {
      const i = 4 * (y * image.width + x);
      const [red, green, blue] = image.data.slice(i, i + 3);
      off = Math.max(off, green, Math.abs(red + blue - 280));
      least = Math.min(least, (red - 40) / 200);
      largest = Math.max(largest, (red - 40) / 200);
    }
  }
  return { least, largest, off };
}

/** Tiles that are drawn on the globe. Here they are made up: their colour is their instant, and early ones take longer than late ones. */
export async function scrubsTiles(journey) {
  const { product, steps } = await productOf(journey);
  const [startMs, endMs] = [Date.parse(steps[0].start), Date.parse(steps.at(-1).end)];
  const asked = [];
  let delayMs = (part) => (part < 0.35 ? SLOW_MS : 100);
  const plant = (page) =>
    page.route(/\/tiles\/[^/]+\/map\/\d+\//, async (route) => {
      const time = new URL(route.request().url()).searchParams.get("time");
      const part = (Date.parse(time) - startMs) / (endMs - startMs);
      asked.push(time);
      await new Promise((resolve) => setTimeout(resolve, delayMs(part)));
      // A request that was called off takes no answer.
      await route.fulfill({ contentType: "image/bmp", body: colouredTile(part) }).catch(() => {});
    });
  const hash = `#product=${product}&mode=map&opacity=1&live=off&camera=-150,8,15000&time=${steps[0].start}`;
  await flown(
    journey,
    hash,
    async (flight) => {
      const { page } = flight;
      const film = await Film.of(page);
      const hand = await thumb(page);
      await eventually(async () => {
        const [{ off }] = await film.read([await film.picture()], partsIn);
        assert.ok(off < 12, "the first instant must lie on the globe");
      });
      await hand.to(0.02);
      await hand.down();
      asked.length = 0;
      await film.start();
      await drag({ page, hand }, 0.02, 0.9, 40, 100);
      await hand.up();
      await atRest(flight);
      const chosen = ((await flight.state()).timeMs - startMs) / (endMs - startMs);
      await eventually(async () => {
        // A screenshot would itself show in the film.
        const [{ least, largest }] = await film.read([film.last], partsIn);
        assert.ok(least > chosen - 0.02 && largest < chosen + 0.02, `the full picture of ${chosen} at rest, not ${[least, largest]}`);
      });
      const frames = await film.read(await film.end(), partsIn);
      const parts = frames.map(({ least, largest }) => (least + largest) / 2);
      const told = frames.map(({ least, largest, off }) => `${least.toFixed(2)}-${largest.toFixed(2)}${off < 12 ? "" : ` off ${off}`}`).join();
      for (const { off } of frames) assert.ok(off < 12, `every picture is one of tiles: ${told}`);
      for (const [i, part] of parts.entries()) assert.ok(i === 0 || part > parts[i - 1] - 0.02, `no older picture follows: ${told}`);
      assert.ok(new Set(parts.map((part) => part.toFixed(2))).size > 6, `the globe follows the hand: ${told}`);
      const instants = new Set(asked);
      assert.ok(instants.size < 30, `of the instants passed by not all are asked for, but ${instants.size} were`);
      await callsOff({ flight, hand, plantDelay: (delay) => (delayMs = delay) });
      await film.close();
    },
    plant,
  );
}

/** Tiles of an instant that never come are given up where the hand rests on another one. */
async function callsOff({ flight, hand, plantDelay }) {
  const { page } = flight;
  const ended = [];
  page.on("requestfailed", (request) => ended.push([new URL(request.url()).searchParams.get("time"), request.failure().errorText]));
  plantDelay((part) => (part < 0.5 ? NEVER_MS : 50));
  await hand.to(0.9);
  await hand.down();
  await hand.to(0.3);
  await flight.until(() => window.fluxglobe.tilesPending > 0);
  const { timeMs } = await flight.state();
  await hand.to(0.7);
  // The hand still holds the thumb.
  await atRest(flight);
  assert.ok(ended.some(([time, why]) => time === iso(timeMs) && why === "net::ERR_ABORTED"), JSON.stringify([iso(timeMs), ended]));
  await hand.up();
  await atRest(flight);
}

/** What is in sight is what is asked for, and nothing is on its way. */
function atRest(flight) {
  return flight.until(() => {
    const { state, shown, tilesPending } = window.fluxglobe;
    return tilesPending === 0 && shown?.endsWith(`${new Date(state.timeMs).toISOString().slice(0, 19)}Z`);
  });
}

async function productOf(journey) {
  const { products } = await journey.api("api/products");
  const { product } = await journey.state();
  return products.find((each) => each.product === product);
}

/** Share of the pixels which the volume changes that are those of the globe without it. */
function bareIn(image, covered, bare) {
  let [count, without] = [0, 0];
  for (let i = 0; i < image.data.length; i += 4) {
    const far = (one, other, least) => [0, 1, 2].some((c) => Math.abs(one.data[i + c] - other.data[i + c]) > least);
    if (!far(covered, bare, 40)) continue;
    count += 1;
    if (!far(image, bare, 8)) without += 1;
  }
  return { count, share: without / Math.max(1, count) };
}

/** The live picture while time is dragged, pictures of it looked at one by one. */
export async function scrubsStream(journey) {
  if (!(await hasStream(journey.base))) return NO_STREAM;
  await flown(journey, ".", async (flight) => {
    const { page } = flight;
    await rests(flight);
    const film = await Film.of(page);
    const overlay = page.locator("#overlay");
    // Pictures of a film lie otherwise than screenshots.
    const filmed = async (visibility) => {
      await overlay.evaluate((element, value) => (element.style.visibility = value), visibility);
      await page.waitForTimeout(SLOW_MS);
      return film.last;
    };
    let [bare, covered] = [];
    // A film lags behind where cores are busy.
    await eventually(async () => {
      await film.start();
      [bare, covered] = [await filmed("hidden"), await filmed("")];
      await film.end();
      const [planted] = await film.read([bare], bareIn, [covered, bare]);
      assert.ok(planted.count > 50_000 && planted.share === 1, `planted: a hole must be noticed: ${JSON.stringify(planted)}`);
    });
    const hand = await thumb(page);
    await hand.to(0.1);
    await hand.down();
    await page.evaluate(() => {
      window.seen = [];
      const look = () => {
        const { picture } = window.fluxglobe;
        const isWhole = getComputedStyle(document.querySelector("#overlay")).opacity === "1";
        const time = picture && isWhole ? new URL(picture.view, location.href).searchParams.get("time") : "none";
        if (window.seen.at(-1) !== time) window.seen.push(time);
        window.looking = requestAnimationFrame(look);
      };
      look();
    });
    // Where the page opened is behind the way that the hand goes.
    await rests(flight);
    await page.evaluate(() => (window.seen = []));
    await film.start();
    await drag({ page, hand }, 0.1, 0.9, 60, 60);
    await hand.up();
    await rests(flight);
    const frames = await film.read(await film.end(), bareIn, [covered, bare]);
    const seen = await page.evaluate(() => (cancelAnimationFrame(window.looking), window.seen));
    assert.ok(frames.length > 5 && seen.length > 3, `${frames.length} pictures of ${seen}`);
    // A few pixels of another month have a colour of the bare globe.
    for (const { share } of frames) assert.ok(share < 0.3, `no picture without the volume: ${frames.map((each) => each.share.toFixed(2))}`);
    assert.ok(!seen.includes("none"), "the picture is never faded out");
    assert.deepEqual(seen, [...seen].sort(), "no older picture follows a newer one");
    const { timeMs } = await flight.state();
    assert.equal(seen.at(-1), iso(timeMs));
    assert.equal((await picture(flight)).kind, "full");
    await film.close();
  });
}

/** A pause, and one step by button or key, land on what was measured; the slider chooses any instant. */
export async function pausesOnSteps(journey) {
  const { product, steps } = await productOf(journey);
  const mids = steps.map(({ mid }) => Date.parse(mid));
  const look = async (flight) => {
    const { page } = flight;
    const { timeMs, playing } = await flight.state();
    assert.ok(mids.includes(timeMs) && !playing, `${iso(timeMs)} must be the middle of a step`);
    await eventually(() => assert.ok(page.url().includes(`time=${iso(timeMs)}`), `${page.url()} must say ${iso(timeMs)}`));
    return timeMs;
  };
  const act = async (flight, isThere) => {
    const { page } = flight;
    const before = (await flight.state()).timeMs;
    await page.locator("#play").click();
    await flight.until((timeMs) => window.fluxglobe.state.timeMs > timeMs, before);
    await page.locator("#play").click();
    const paused = await look(flight);
    assert.ok(paused > before, "time goes on to a step, not back");
    await isThere(flight);
    await page.locator("#step-forward").click();
    assert.equal(await look(flight), mids[mids.indexOf(paused) + 1]);
    await page.locator("#time").press("PageDown");
    assert.equal(await look(flight), paused);
    await page.locator("#time").press("ArrowRight");
    const { timeMs } = await flight.state();
    assert.ok(timeMs > paused && !mids.includes(timeMs), "arrow keys choose what lies between");
    await page.locator("#step-back").click();
    assert.equal(await look(flight), paused);
    await isThere(flight);
  };
  const hash = (rest) => `#product=${product}&time=${steps[1].start}&camera=-150,8,15000&${rest}`;
  await flown(journey, hash("mode=map&live=off"), (flight) => act(flight, atRest));
  if (!(await hasStream(journey.base))) return NO_STREAM;
  await flown(journey, hash("mode=volume"), (flight) => act(flight, rests));
}
