//! The example pages of docs/map-clients in a real browser against a running server: FLUXGLOBE_URL in, checks and (with
//! FLUXGLOBE_SCREENSHOTS) pictures out.
import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import test from "node:test";
import { Film } from "./film.mjs";
import { openBrowser } from "./harness.mjs";
import { LIMIT_MS } from "./journey.mjs";
import { servePages, throughTo } from "./map-clients-pages.mjs";

const SERVER = process.env.FLUXGLOBE_URL;
const SCREENSHOTS = process.env.FLUXGLOBE_SCREENSHOTS;
/** One instant a month: a round that a processor draws while somebody waits. */
const LAST = 11;
const IMMUTABLE = "public, max-age=31536000, immutable";

for (const client of ["maplibre", "openlayers", "leaflet"]) {
  test(`the example for ${client}`, async (t) => {
    assert.ok(SERVER, "FLUXGLOBE_URL must hold the address of a running server, e.g. http://127.0.0.1:8080/");
    const pages = await servePages();
    const way = await throughTo(SERVER);
    // A browser of its own: what another page asked for is in its cache.
    const browser = await openBrowser({ width: 720, height: 480 });
    const page = browser.context.pages()[0] ?? (await browser.context.newPage());
    page.setDefaultTimeout(LIMIT_MS);
    const film = await Film.of(page);
    const errors = [];
    page.on("pageerror", (error) => errors.push(error.message));
    const seen = { errors, page, way, film, pages, client, address: (query = "") => `${pages.url}/${client}.html?server=${way.url}${query}` };
    const step = (sentence, act) =>
      t.test(sentence, async () => {
        await act(seen);
        assert.deepEqual(errors, [], "the page must stay without error");
      });
    try {
      await step("shows a layer with date, legend and attribution", shows);
      await step("shows another instant when the slider is moved", slides);
      await step("plays a year without a moment without tiles", plays);
      await step("plays it again from the browser's cache", playsAgain);
      await step("waits, and keeps the picture, while the server is slow", waits);
      await step("says when the server is gone, keeps the picture, and plays on when it is back", saysAndGoesOn);
      await step("says what the server has against it", refused);
    } finally {
      await browser.close();
      way.close();
      pages.close();
    }
  });
}

const until = (page, condition, argument) => page.waitForFunction(condition, argument, { timeout: LIMIT_MS });
const date = (page) => page.textContent("#date");
const dated = (page) => until(page, () => document.querySelector("#date").textContent);

async function shows({ page, way, film, address, client }) {
  const answers = [];
  page.on("response", (response) => answers.push(response));
  await page.goto(address("&between=1"));
  await dated(page);
  assert.equal(await date(page), "16 January 2000");
  await until(page, () => document.querySelector("#legend").naturalWidth > 100);
  await page.getByText("Takahashi et al. (2009)").waitFor();
  assert.ok(await page.isHidden("#problem"));
  film.all = await film.covered();
  assert.ok(film.all > 0.4, `tiles cover ${film.all} of the map`);
  const tiles = answers.filter((answer) => new URL(answer.url()).pathname.startsWith("/tiles/") && answer.url().includes(".png"));
  assert.ok(tiles.length > 0 && way.tiles().length > 0);
  for (const tile of tiles) assert.equal(tile.headers()["cache-control"], IMMUTABLE, tile.url());
  if (SCREENSHOTS) {
    mkdirSync(SCREENSHOTS, { recursive: true });
    await page.screenshot({ path: join(SCREENSHOTS, `map-client-${client}.png`) });
  }
}

async function slides({ page, film }) {
  const january = await film.picture();
  await page.locator("#slider").fill("6");
  await until(page, () => document.querySelector("#date").textContent === "16 July 2000");
  const july = await film.picture();
  const changed = await film.changed(january, july);
  assert.ok(changed > 0.2, `${changed} of the map changed`);
  assert.ok((await film.covered()) > film.all - 0.02);
}

/** Plays until the slider comes to its end and from there to `first`; returns what was seen meanwhile. */
async function round({ page, film }) {
  await page.evaluate(() => {
    window.dates = [];
    const look = () => window.dates.push(document.querySelector("#date").textContent);
    window.looks?.disconnect();
    window.looks = new MutationObserver(look);
    window.looks.observe(document.querySelector("#date"), { childList: true });
  });
  await film.start();
  await page.click("#play");
  await until(page, (last) => Number(document.querySelector("#slider").value) === last, LAST);
  await until(page, () => document.querySelector("#date").textContent === "16 January 2000");
  await page.click("#play");
  const frames = await film.stop();
  // What was on its way comes yet.
  await until(page, () => !document.querySelector("#date").classList.contains("waits"));
  return { frames, dates: await page.evaluate(() => window.dates) };
}

/** Playing stops some instants after January, the more the busier the machine is. */
async function backToJanuary({ page }) {
  await page.locator("#slider").fill("0");
  await until(page, () => document.querySelector("#date").textContent === "16 January 2000");
}

async function plays(seen) {
  await backToJanuary(seen);
  const { frames, dates } = await round(seen);
  const months = dates.slice(0, LAST).map((text) => text.split(" ")[1]);
  assert.deepEqual(months.join(" "), "February March April May June July August September October November December");
  assert.ok(frames.length >= LAST, `${frames.length} pictures were seen of a year`);
  for (const covered of frames) assert.ok(covered > seen.film.all - 0.02, `tiles cover ${covered} of the map, before ${seen.film.all}`);
}

async function playsAgain(seen) {
  await backToJanuary(seen);
  const before = seen.way.tiles().length;
  const { dates } = await round(seen);
  assert.ok(dates.length >= LAST, `${dates.length} instants`);
  assert.deepEqual(seen.way.tiles().slice(before), [], "the server is asked for nothing that was shown before");
}

async function waits({ page, way, film, address }) {
  // Other instants than before.
  await page.goto(address("&between=2"));
  await dated(page);
  await page.locator("#slider").fill("1");
  await until(page, () => document.querySelector("#date").textContent === "31 January 2000");
  way.delayMs = 1500;
  await page.locator("#slider").fill("2");
  await until(page, () => document.querySelector("#date").textContent === "15 February 2000");
  await film.start();
  await page.click("#play");
  await page.locator("#date.waits").waitFor();
  assert.equal(await date(page), "15 February 2000");
  await until(page, () => document.querySelector("#date").textContent === "1 March 2000");
  const frames = await film.stop();
  for (const covered of frames) assert.ok(covered > film.all - 0.02, `tiles cover ${covered} of the map, before ${film.all}`);
  way.delayMs = 0;
}

async function saysAndGoesOn({ page, way, film, address }) {
  await page.goto(address("&between=3"));
  await dated(page);
  way.isCut = true;
  await page.click("#play");
  await page.getByText("does not answer").waitFor();
  assert.equal(await date(page), "16 January 2000");
  assert.equal(await page.textContent("#play"), "Play");
  assert.ok((await film.covered()) > film.all - 0.02);
  way.isCut = false;
  await page.click("#play");
  await until(page, () => document.querySelector("#date").textContent === "26 January 2000");
  assert.ok(await page.isHidden("#problem"));
  await page.click("#play");
}

async function refused({ page, way, address, errors }) {
  await page.goto(address("&product=nothing"));
  await page.getByText("nothing").waitFor();
  assert.match(await page.textContent("#problem"), /no product|unknown|nothing/i);
  way.isCut = true;
  await page.goto(address());
  await page.getByText("does not answer").waitFor();
  way.isCut = false;
  // Both stand in the console as well.
  assert.equal(errors.splice(0).length, 2);
}
