//! A step that comes again: what a browser was once shown it keeps, and asks the server for nothing.
import assert from "node:assert/strict";
import { openBrowser } from "./harness.mjs";
import { Journey, LIMIT_MS } from "./journey.mjs";
import { throughTo } from "./map-clients-pages.mjs";
import { eventually } from "./reading.mjs";

const IMMUTABLE = "public, max-age=31536000, immutable";

/** In a browser of its own, which has nothing yet: requests that are routed are not cached, so they are counted on their way. */
export async function keepsTiles(journey) {
  const { product } = await journey.state();
  const { products } = await journey.api("api/products");
  const { steps } = products.find((each) => each.product === product);
  const way = await throughTo(journey.base);
  // As after an hour: of what may only be kept for a minute the server would be asked again.
  way.ageS = 3600;
  const browser = await openBrowser({ width: 800, height: 500 });
  try {
    const page = browser.context.pages()[0] ?? (await browser.context.newPage());
    page.setDefaultTimeout(LIMIT_MS);
    const answers = [];
    page.on("response", (response) => response.url().includes(".png?") && answers.push(response));
    const visit = new Journey(page, undefined, way.url);
    const shows = (index) =>
      visit.until((time) => window.fluxglobe?.shown?.endsWith(time) && window.fluxglobe.tilesPending === 0, steps[index].mid);
    await page.goto(`${way.url}/#product=${product}&mode=map&live=off&camera=-150,8,15000&time=${steps[1].mid}`);
    await shows(1);
    await page.locator("#step-forward").click();
    await shows(2);
    const before = way.tiles().length;
    assert.ok(before > 0);
    for (const answer of answers) assert.equal(answer.headers()["cache-control"], IMMUTABLE, answer.url());
    await page.locator("#step-back").click();
    await shows(1);
    assert.deepEqual(way.tiles().slice(before), [], "an instant that comes again");
    await eventually(() => assert.ok(page.url().includes(steps[1].mid)));
    await page.reload();
    await shows(1);
    await page.locator("#step-forward").click();
    await shows(2);
    assert.deepEqual(way.tiles().slice(before), [], "a page that is opened again");
    // Another look has addresses of its own, which last as long.
    await page.locator("#tab-look").click();
    await page.locator("#coastlines").check();
    await visit.until(() => window.fluxglobe.shown?.includes("?coastlines=true@") && window.fluxglobe.tilesPending === 0);
    assert.ok(way.tiles().length > before);
    for (const answer of answers) assert.equal(answer.headers()["cache-control"], IMMUTABLE, answer.url());
  } finally {
    await browser.close();
    way.close();
  }
}
