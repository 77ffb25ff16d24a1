//! Steps that hold the cards' numbers against the server's own answers: series, budget, check.
import assert from "node:assert/strict";
import { eventually, hasInk, number } from "./reading.mjs";

/** Sea in every product of the demo, and in sight from where the page begins. */
const SEA = { lon: -150.5, lat: -5.5 };
/** Where the page begins. */
const HOME_LON = -150;
const LAND = { lon: 10.5, lat: 22.5 };

export async function seriesOfSea(journey) {
  const { page } = journey;
  await page.locator("#time").press("Home");
  const at = await page.evaluate(({ lon, lat }) => window.fluxglobe.project(lon, lat), SEA);
  assert.ok(at, "the place must be on the near side");
  await page.locator("#globe canvas").first().click({ position: at });
  await page.locator("#series-plot canvas").waitFor();
  const { place, product } = await journey.state();
  assert.ok(
    Math.abs(place.lon - SEA.lon) < 1 && Math.abs(place.lat - SEA.lat) < 1,
    `clicked ${SEA.lon},${SEA.lat}, got ${place.lon},${place.lat}`,
  );
  const { series } = await journey.api(`api/products/${product}/point`, {
    lon: place.lon.toFixed(4),
    lat: place.lat.toFixed(4),
  });
  assert.ok(series.some((row) => row.value !== null));
  await eventually(async () => {
    assert.equal(await page.locator("#series-plot").getAttribute("data-points"), String(series.length));
    // At the range's start the first value holds.
    const shown = number(await page.locator("#place-value").innerText());
    assert.ok(
      Math.abs(shown - series[0].value) <= Math.abs(series[0].value) * 0.01 + 1e-6,
      `${shown} must be ${series[0].value}`,
    );
  });
  await hasInk(page, "#series-plot canvas");
  await journey.shot("place");
}

export async function landHasNoData(journey) {
  const { page } = journey;
  await page.locator("#place-lat").fill(String(LAND.lat));
  await page.locator("#place-lon").fill(String(LAND.lon));
  await page.locator("#place-lon").press("Enter");
  await page.locator("#no-data").waitFor();
  assert.match(await page.locator("#no-data").innerText(), /no data/i);
  await page.locator("#series-plot").waitFor({ state: "detached" });
  await turnsHome(journey);
}

/** Back to where the page began: a typed place that was out of sight has turned the globe. */
async function turnsHome({ page }) {
  await page.locator('[aria-label="Back to the start"]').click();
  await page.waitForFunction((lon) => Math.abs(window.fluxglobe.state.camera.lon - lon) < 0.01, HOME_LON);
}

/** The far side is turned to, and what is in sight already stays where it is. */
export async function typedPlaceIsTurnedTo(journey) {
  const { page } = journey;
  const camera = async () => (await journey.state()).camera;
  const type = async ({ lon, lat }) => {
    await page.locator("#place-lat").fill(String(lat));
    await page.locator("#place-lon").fill(String(lon));
    await page.locator("#place-lon").press("Enter");
  };
  const start = await camera();
  await type(SEA);
  await page.locator("#series-plot").waitFor();
  assert.deepEqual(await camera(), start, "what is in sight is not turned to");
  const far = { lon: wrapped(start.lon + 170), lat: 12 };
  assert.equal(await page.evaluate(({ lon, lat }) => window.fluxglobe.project(lon, lat), far), undefined);
  await type(far);
  await journey.until(({ lon, lat }) => {
    const { camera } = window.fluxglobe.state;
    return Math.abs(camera.lon - lon) < 0.5 && Math.abs(camera.lat - lat) < 0.5;
  }, far);
  assert.ok(await page.evaluate(({ lon, lat }) => window.fluxglobe.project(lon, lat), far));
  await turnsHome(journey);
}

/** A longitude from -180 to 180. */
function wrapped(lon) {
  return ((lon + 540) % 360) - 180;
}

export async function budgetTotal(journey) {
  const { page } = journey;
  await page.locator("#tab-budget").click();
  await page.locator("#budget-total").waitFor();
  const { product: id, manifest, steps } = await journey.product();
  const answer = await journey.api(`api/products/${id}/budget`, {
    region: "global",
    from: steps[0].start,
    to: steps[steps.length - 1].end,
    step: "total",
    earth: "wgs84",
  });
  const [total] = answer.rows;
  await eventually(async () => {
    const text = await page.locator("#budget-total").innerText();
    assert.ok(Math.abs(number(text) - total.budget_tg) <= 0.05 + 1e-9, `${text} must be ${total.budget_tg}`);
    const named = await page.locator("#panel-budget .manifest code").innerText();
    assert.ok(named.includes(manifest), "the manifest must be named");
    assert.equal(await page.locator("#budget-table tbody tr").count(), steps.length);
  });
  await hasInk(page, "#budget-plot canvas");
  await journey.shot("budget");
}

export async function checkTable(journey) {
  const { page } = journey;
  await page.locator("#tab-check").click();
  const { rows } = await journey.api("api/check");
  assert.ok(rows.length > 0);
  await eventually(async () => {
    assert.equal(await page.locator("#check-table tbody").count(), rows.length);
    assert.ok((await page.locator("#check-table").innerText()).includes(rows[0].what.replace(/CO2/g, "CO₂")));
  });
  await journey.shot("check");
  await page.locator("#panels .quiet").first().click();
}
