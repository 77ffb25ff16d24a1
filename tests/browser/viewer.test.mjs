//! The viewer in a real browser against a running server: FLUXGLOBE_URL in, checks and (with FLUXGLOBE_SCREENSHOTS) pictures out.
import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import test from "node:test";
import { testHarness } from "./harness-self.mjs";
import { openBrowser, visiblePixels, Watch } from "./harness.mjs";

const URL_ASKED = process.env.FLUXGLOBE_URL;
const SHOTS = process.env.FLUXGLOBE_SCREENSHOTS;
/** A processor that draws the globe and the tiles and builds something else besides is slow, not broken. */
const LIMIT_MS = Number(process.env.FLUXGLOBE_LIMIT_MS ?? 60_000);

/** Sea in every product of the demo, and in sight from where the page begins. */
const SEA = { lon: -150.5, lat: -5.5 };
const LAND = { lon: 10.5, lat: 22.5 };

test("the harness sees what it is there to see", testHarness);

test("the viewer", async (t) => {
  assert.ok(URL_ASKED, "FLUXGLOBE_URL must hold the address of a running server, e.g. http://127.0.0.1:8080/");
  const base = new URL(URL_ASKED);
  const browser = await openBrowser();
  const watch = new Watch(browser.context, base.origin);
  const page = browser.context.pages()[0] ?? (await browser.context.newPage());
  page.setDefaultTimeout(LIMIT_MS);
  const journey = new Journey(page, watch, base);
  const step = (sentence, act, { isCleanPage = true } = {}) =>
    t.test(sentence, async () => {
      const startedMs = Date.now();
      try {
        assert.ok(journey.hasLoaded || act === loads, "the page never loaded, so there is nothing to look at");
        await act(journey);
        // Attributed to the step during which it happened; the last check of all looks at the whole list again.
        if (isCleanPage) assert.deepEqual(watch.problems, [], "the page must stay without error");
      } catch (error) {
        await journey.shot(`failed-${sentence.replace(/\W+/g, "-")}`);
        throw plain(error, watch);
      } finally {
        if (process.env.FLUXGLOBE_TIMES) console.error(`${((Date.now() - startedMs) / 1000).toFixed(1)} s  ${sentence}`);
      }
    });

  try {
    await step("loads and draws its first layer", loads);
    await step("fetches tiles that show something", tilesArrive);
    await step("shows the product's unit in the legend", legendHasUnit);
    await step("moves in time with the slider and fetches other tiles", sliderMoves);
    await step("plays and pauses", plays);
    await step("plots the series of a place in the sea that is clicked", seriesOfSea);
    await step("says of a typed place on land that there is no data", landHasNoData);
    await step("shows the server's own budget total", budgetTotal);
    await step("shows the check table", checkTable);
    await step("fetches volume tiles in volume mode", volumeMode);
    await step("shows the rendered view in a dialog", renderedView);
    await step("has nothing to complain about at the end", async () => {});
    // From here on errors are planted, so the clean list is no longer asked for.
    const planted = { isCleanPage: false };
    await step("opens a shared address as the same view, and marks synthetic data", sharedAddress, planted);
    await step("tells the server's reason when tiles are refused", refusedTiles, planted);
    await step("says when the server is gone, and goes on when it is back", lostServer, planted);
  } finally {
    await browser.close();
  }
});

/** An error without terminal colours, which break the reports of older test runners, and with what the page complained of. */
function plain(error, watch) {
  const text = (error.message ?? String(error)).replace(/\x1B\[[0-9;]*m/g, "");
  const complaints = watch.problems.length > 0 && !text.includes("must stay without error") ? `\nThe page said:\n${watch.problems.join("\n")}` : "";
  return new Error(text + complaints);
}

class Journey {
  hasLoaded = false;

  constructor(page, watch, base) {
    Object.assign(this, { page, watch, base });
  }

  state() {
    return this.page.evaluate(() => window.fluxglobe.state);
  }

  shown() {
    return this.page.evaluate(() => window.fluxglobe.shown ?? "");
  }

  until(condition, argument) {
    return this.page.waitForFunction(condition, argument, { timeout: LIMIT_MS });
  }

  async api(path, query = {}) {
    const url = new URL(path, this.base);
    for (const [key, value] of Object.entries(query)) url.searchParams.set(key, value);
    const answer = await fetch(url);
    assert.equal(answer.status, 200, `${url} must answer 200`);
    return answer.json();
  }

  /** The product on show, as the server describes it. */
  async product() {
    const { product } = await this.state();
    return (await this.api("api/products")).products.find((each) => each.id === product);
  }

  async shot(name) {
    if (!SHOTS) return;
    mkdirSync(SHOTS, { recursive: true });
    await this.page.screenshot({ path: join(SHOTS, `${name}.png`) });
  }
}

async function loads(journey) {
  const { page, base } = journey;
  const answer = await page.goto(base.href);
  assert.equal(answer.status(), 200);
  await page.waitForFunction(() => window.fluxglobe?.ready === true, undefined, { timeout: LIMIT_MS });
  assert.ok(await page.locator("#globe canvas").isVisible());
  journey.hasLoaded = true;
}

async function tilesArrive(journey) {
  const { mode } = await journey.state();
  const counts = await journey.page.evaluate(() => ({ loaded: window.fluxglobe.tilesLoaded, failed: window.fluxglobe.tilesFailed }));
  assert.ok(counts.loaded > 0, "tiles must have been loaded");
  assert.equal(counts.failed, 0);
  await assertTilesVisible(journey, journey.watch.tiles(mode));
  await journey.shot("map");
}

async function assertTilesVisible(journey, tiles) {
  assert.ok(tiles.length > 0, "the server must have been asked for tiles");
  for (const tile of tiles) assert.equal(tile.status(), 200, tile.url());
  assert.match(tiles[0].headers()["content-type"] ?? "", /^image\/png/);
  let visible = 0;
  for (const tile of tiles.slice(0, 8)) visible += await visiblePixels(journey.page, tile.url());
  assert.ok(visible > 0, "at least one of the tiles must show a pixel");
}

async function legendHasUnit(journey) {
  const { legend } = await journey.product();
  const text = await journey.page.locator("#legend .legend-unit").innerText();
  // Typography differs (superscripts, thin spaces), letters and figures do not.
  assert.equal(letters(text), letters(legend.unit));
  assert.notEqual(letters(legend.unit), "");
  assert.ok((await journey.page.locator("#legend .legend-tick").count()) >= 2);
}

async function sliderMoves(journey) {
  const { page, watch } = journey;
  const before = { state: await journey.state(), shown: await journey.shown(), responses: watch.responses.length };
  const box = await page.locator("#time").boundingBox();
  const y = box.y + box.height / 2;
  await page.mouse.move(box.x + box.width * 0.05, y);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.3, y, { steps: 4 });
  await page.mouse.move(box.x + box.width * 0.53, y, { steps: 4 });
  await page.mouse.up();
  await journey.until((shown) => window.fluxglobe.shown !== shown && window.fluxglobe.tilesPending === 0, before.shown);
  const after = await journey.state();
  const { steps } = await journey.product();
  const [start, end] = [Date.parse(steps[0].start), Date.parse(steps[steps.length - 1].end)];
  assert.ok(Math.abs((after.timeMs - start) / (end - start) - 0.53) < 0.1, "the instant must be where the thumb was let go");
  await journey.until((iso) => window.fluxglobe.shown?.endsWith(iso), iso(after.timeMs));
  const times = new Set(watch.tiles(after.mode, before.responses).map((tile) => new URL(tile.url()).searchParams.get("time")));
  assert.ok(times.has(iso(after.timeMs)), `tiles of ${iso(after.timeMs)} must have been fetched, not only of ${[...times]}`);
  assert.ok(!times.has(iso(before.state.timeMs)));
  await page.locator("#time").press("Home");
  assert.equal((await journey.state()).timeMs, start, "Home goes to the start");
}

async function plays(journey) {
  const { page } = journey;
  const before = await journey.state();
  await page.locator("#play").click();
  const shown = new Set();
  for (let frames = 0; frames < 2; frames++) {
    const known = await journey.shown();
    await journey.until((last) => window.fluxglobe.shown !== last, known);
    shown.add(await journey.shown());
  }
  assert.equal(shown.size, 2, "two further instants must have been shown");
  await page.locator("#play").click();
  const after = await journey.state();
  assert.equal(after.playing, false);
  assert.ok(after.timeMs > before.timeMs, "time must have gone on");
}

async function seriesOfSea(journey) {
  const { page } = journey;
  await page.locator("#time").press("Home");
  const at = await page.evaluate(({ lon, lat }) => window.fluxglobe.project(lon, lat), SEA);
  assert.ok(at, "the place must be on the near side");
  await page.locator("#globe canvas").first().click({ position: at });
  await page.locator("#series-plot canvas").waitFor();
  const { place, product } = await journey.state();
  assert.ok(Math.abs(place.lon - SEA.lon) < 1 && Math.abs(place.lat - SEA.lat) < 1, `clicked ${SEA.lon},${SEA.lat}, got ${place.lon},${place.lat}`);
  const { series } = await journey.api(`api/products/${product}/point`, { lon: place.lon.toFixed(4), lat: place.lat.toFixed(4) });
  assert.equal(await page.locator("#series-plot").getAttribute("data-points"), String(series.length));
  assert.ok(series.some((row) => row.value !== null));
  // At the range's start the first value holds.
  const shown = number(await page.locator("#place-value").innerText());
  assert.ok(Math.abs(shown - series[0].value) <= Math.abs(series[0].value) * 0.01 + 1e-6, `${shown} must be ${series[0].value}`);
  assert.ok((await inkOf(page, "#series-plot canvas")) > 500, "the plot must have been drawn");
  await journey.shot("place");
}

async function landHasNoData(journey) {
  const { page } = journey;
  await page.locator("#place-lat").fill(String(LAND.lat));
  await page.locator("#place-lon").fill(String(LAND.lon));
  await page.locator("#place-lon").press("Enter");
  await page.locator("#no-data").waitFor();
  assert.match(await page.locator("#no-data").innerText(), /no data/i);
  assert.equal(await page.locator("#series-plot").count(), 0);
}

async function budgetTotal(journey) {
  const { page } = journey;
  await page.locator("#tab-budget").click();
  await page.locator("#budget-total").waitFor();
  const { id, manifest, steps } = await journey.product();
  const answer = await journey.api(`api/products/${id}/budget`, {
    region: "global", from: steps[0].start, to: steps[steps.length - 1].end, step: "total", earth: "wgs84",
  });
  const [total] = answer.rows;
  const text = await page.locator("#budget-total").innerText();
  assert.ok(Math.abs(number(text) - total.budget) <= 0.05 + 1e-9, `${text} must be ${total.budget}`);
  assert.ok((await page.locator("#panel-budget .manifest code").innerText()).includes(manifest), "the manifest must be named");
  assert.equal(await page.locator("#budget-table tbody tr").count(), steps.length);
  assert.ok((await inkOf(page, "#budget-plot canvas")) > 500, "the bars must have been drawn");
  await journey.shot("budget");
}

async function checkTable(journey) {
  const { page } = journey;
  await page.locator("#tab-check").click();
  const { rows } = await journey.api("api/check");
  assert.ok(rows.length > 0);
  assert.equal(await page.locator("#check-table tbody tr").count(), rows.length);
  assert.ok((await page.locator("#check-table").innerText()).includes(rows[0].what.replace(/CO2/g, "CO₂")));
  await journey.shot("check");
  await page.locator("#panels .quiet").first().click();
}

async function volumeMode(journey) {
  const { page, watch } = journey;
  const from = watch.responses.length;
  await page.locator('button[data-mode="volume"]').click();
  await journey.until(() => window.fluxglobe.shown?.includes("/volume@") && window.fluxglobe.tilesPending === 0);
  await assertTilesVisible(journey, watch.tiles("volume", from));
  await journey.shot("volume");
}

async function renderedView(journey) {
  const { page } = journey;
  await page.locator("#render-view").click();
  await page.locator("#view-image").waitFor();
  const source = await page.locator("#view-image").getAttribute("src");
  assert.ok((await visiblePixels(page, source)) > 1000, "the image must show the globe");
  assert.ok(journey.watch.responses.some((response) => /\/globe\/.*\/volume\.png/.test(response.url()) && response.status() === 200));
  await journey.shot("view");
  await page.keyboard.press("Escape");
}

async function sharedAddress(journey) {
  const { page, base } = journey;
  const { id, steps } = await journey.product();
  const time = steps[Math.min(3, steps.length - 1)].mid;
  await page.route("**/api/products", async (route) => {
    const answer = await route.fetch();
    const body = await answer.json();
    for (const product of body.products) product.synthetic = true;
    await route.fulfill({ json: body });
  });
  assert.equal(await page.locator("#synthetic").isVisible(), false);
  await page.goto("about:blank");
  await page.goto(new URL(`#product=${id}&mode=map&time=${time}&camera=-120,-20,15000&place=-120.5,-20.5&tab=place`, base).href);
  await journey.until(() => window.fluxglobe?.ready === true);
  const state = await journey.state();
  assert.equal(state.timeMs, Date.parse(time));
  assert.ok(Math.abs(state.camera.lon + 120) < 0.1 && Math.abs(state.camera.heightKm - 15000) < 10);
  await page.locator("#series-plot canvas").waitFor();
  assert.match(await page.locator("#synthetic").innerText(), /synthetic/i);
  assert.ok(await page.locator("#synthetic").isVisible());
  await journey.shot("synthetic");
}

async function refusedTiles(journey) {
  const { page } = journey;
  const reason = "planted: the render worker is away";
  await page.route("**/tiles/**/*.png?*", (route) => route.fulfill({ status: 503, json: { error: reason } }));
  await page.locator("#time").press("PageUp");
  await page.locator(".notice", { hasText: reason }).waitFor();
  await journey.shot("refused");
}

async function lostServer(journey) {
  const { page } = journey;
  await page.unroute("**/tiles/**/*.png?*");
  const before = await journey.shown();
  await page.context().setOffline(true);
  await page.locator("#time").press("PageUp");
  await page.locator('.notice[data-key="connection"]').waitFor();
  assert.equal(await journey.shown(), before, "the last picture must stay");
  await journey.shot("gone");
  await page.context().setOffline(false);
  await page.locator('.notice[data-key="connection"]').waitFor({ state: "detached" });
  await journey.until((iso) => window.fluxglobe.shown?.endsWith(iso), iso((await journey.state()).timeMs));
}

/** Canvas pixels that carry ink. */
function inkOf(page, selector) {
  return page.locator(selector).first().evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let i = 3; i < data.length; i += 4) if (data[i] > 0) count += 1;
    return count;
  });
}

function iso(timeMs) {
  return `${new Date(timeMs).toISOString().slice(0, 19)}Z`;
}

function number(text) {
  return Number(text.replace(/\u2212/g, "-").replace(/[\s\u2009\u202f]/g, ""));
}

function letters(text) {
  const plain = text.replace(/[⁰¹²³⁴⁵⁶⁷⁸⁹₂]/g, (sign) => ({ "₂": "2" })[sign] ?? String("⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(sign)));
  return plain.replace(/⁻/g, "-").replace("°C", "degC").replace(/[\s\u202f^*]/g, "");
}
