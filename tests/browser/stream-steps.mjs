//! Steps that need what streams in: platforms on the globe with what they measured, and new data in a page that is open.
import assert from "node:assert/strict";
import { execSync } from "node:child_process";
import { LIMIT_MS } from "./journey.mjs";
import { eventually, hasInk, letters } from "./reading.mjs";

/** A command that makes new data of the product on show land on the server; without it only the page's half is tried. */
const LAND = process.env.FLUXGLOBE_LAND;

/** Landing also computes what follows from it. */
const LANDING_MS = 5 * LIMIT_MS;

/** Returns why it looked at less than it could. */
export async function observationsOfPlatform(journey) {
  const { page, base } = journey;
  const answer = await fetch(new URL("api/observations/platforms", base));
  if (answer.status === 404) return "this server has no observations";
  assert.equal(answer.status, 200);
  const { features } = await answer.json();
  await page.locator("#observations").check();
  // The answer changes the line; the list of none is as long before the answer as after it.
  await page.locator("#observations-status").filter({ hasNotText: /^$|asking/ }).waitFor();
  await journey.until((count) => window.fluxglobe.platforms.length === count, features.length);
  if (features.length === 0) {
    await page.locator("#observations-status").filter({ hasText: /none/ }).waitFor();
    await page.locator("#observations").uncheck();
    return "the server has observations of no platform";
  }
  const chosen = await inSight(page);
  if (chosen === undefined) return "no platform is on the near side of the globe";
  await page.locator("#globe canvas").first().click({ position: chosen.at });
  await page.locator("#platform-plot canvas").waitFor();
  await page.locator("#platform-name").filter({ hasText: /\S/ }).waitFor();
  const name = await page.locator("#platform-name").innerText();
  const hit = features.find((feature) => feature.properties.platform === name);
  assert.ok(hit, `${name} must be one of the server's platforms`);
  const { dataset, platform } = hit.properties;
  const path = `api/observations/${encodeURIComponent(dataset)}/${encodeURIComponent(platform)}`;
  const { observations } = await journey.api(path);
  const plot = page.locator("#platform-plot");
  await eventually(async () => {
    assert.ok(Number(await plot.getAttribute("data-points")) > 0);
    const unit = await plot.getAttribute("data-unit");
    assert.ok(
      observations.some((one) => one.unit === unit),
      `${unit} must be a unit of the server's`,
    );
    const quality = await page.locator("#platform-quality").innerText();
    assert.match(quality, /good|not evaluated|questionable|bad/);
    assert.ok(letters(quality).includes(letters(unit).slice(0, 1)), `${quality} must name the unit ${unit}`);
  });
  await hasInk(page, "#platform-plot canvas");
  await journey.shot("observed");
  await page.locator("#observations").uncheck();
  await journey.until(() => window.fluxglobe.platforms.length === 0);
  await page.locator("#tab-platform").waitFor({ state: "hidden" });
}

/** A platform whose place is on the canvas and not under a card. */
function inSight(page) {
  return page.evaluate(() => {
    const canvas = document.querySelector("#globe canvas");
    const { left, top } = canvas.getBoundingClientRect();
    for (const { id, lon, lat } of window.fluxglobe.platforms) {
      const at = window.fluxglobe.project(lon, lat);
      if (at && document.elementFromPoint(left + at.x, top + at.y) === canvas) return { id, at };
    }
    return undefined;
  });
}

/** New data lands while the page is open. Returns why it was not tried. */
export async function newDataLands(journey) {
  if (!LAND) return "FLUXGLOBE_LAND names no command that lands new data";
  const { page, watch } = journey;
  const before = await journey.product();
  const from = watch.responses.length;
  const tiles = () => watch.tiles(mode, from).map((tile) => new URL(tile.url()).searchParams);
  const { mode } = await journey.state();
  await page.evaluate(() => (window.stillTheSamePage = true));
  execSync(LAND, { stdio: "inherit", timeout: LANDING_MS });
  await page.locator('.notice[data-key="news"]', { hasText: "New data" }).waitFor({ timeout: LIMIT_MS });
  await journey.until((manifest) => !window.fluxglobe.shown?.includes(`:${manifest}`), before.manifest);
  assert.ok(await page.evaluate(() => window.stillTheSamePage), "the page must not have been loaded again");
  const { manifest } = await journey.product();
  assert.notEqual(manifest, before.manifest);
  const asked = tiles().filter((query) => query.get("manifest") === manifest);
  // Which edition depends on whether what is derived has landed by then.
  assert.ok(asked.length > 0 && asked.every((query) => query.has("edition")), `${asked.length} tiles of the new version`);
  await journey.shot("new-data");
}

/** The page's half alone: a planted stream tells of new data, and the pictures in sight are asked for again. */
export async function newDataIsShown(journey) {
  const { page, base, watch } = journey;
  const { product: id, title, manifest, steps } = await journey.product();
  const touched = [{ start: steps[0].start, end: steps[steps.length - 1].end }];
  const data = JSON.stringify({ product: id, manifest, touched });
  await page.goto("about:blank");
  // What lifts particles has come: the server names another edition of the same version.
  const edition = "0123456789abcdef";
  let isTold = false;
  await page.route("**/tiles/*/map.json?*", async (route) => {
    const answer = await (await route.fetch()).text();
    await route.fulfill({ contentType: "application/json", body: isTold ? answer.replace(/edition=[0-9a-f]{16}/g, `edition=${edition}`) : answer });
  });
  // What is answered once ends at once: the browser then waits long enough not to be told twice.
  await page.route("**/api/events", async (route) => {
    await page.waitForFunction(() => window.fluxglobe?.ready === true, undefined, { timeout: LIMIT_MS });
    isTold = true;
    const body = `retry: 600000\nid: 1\nevent: product\ndata: ${data}\n\n`;
    await route.fulfill({ contentType: "text/event-stream", body });
  });
  const from = watch.responses.length;
  await page.goto(new URL(`#product=${id}&mode=map&time=${steps[0].mid}`, base).href);
  const notice = page.locator('.notice[data-key="news"]');
  await notice.waitFor({ timeout: LIMIT_MS });
  assert.ok(isTold);
  assert.equal(letters(await notice.innerText()), letters(`New data: ${title}`));
  await journey.until(() => window.fluxglobe.shown?.includes("+1/") && window.fluxglobe.tilesPending === 0);
  const tiles = watch.tiles("map", from).map((tile) => new URL(tile.url()).searchParams);
  assert.ok(
    tiles.some((query) => query.get("edition") === edition && query.get("manifest") === manifest),
    "the pictures must have been asked for again at another address",
  );
  await page.unroute("**/api/events");
  await page.unroute("**/tiles/*/map.json?*");
  await journey.shot("told");
}
