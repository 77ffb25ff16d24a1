//! Steps with something planted: a shared address to synthetic data, refused tiles, a server that is gone for a while.
import assert from "node:assert/strict";
import { iso } from "./reading.mjs";

export async function sharedAddress(journey) {
  const { page, base } = journey;
  const { product: id, steps } = await journey.product();
  const time = steps[Math.min(3, steps.length - 1)].mid;
  await page.route("**/api/products", async (route) => {
    const answer = await route.fetch();
    const body = await answer.json();
    for (const product of body.products) product.synthetic = true;
    await route.fulfill({ json: body });
  });
  assert.equal(await page.locator("#synthetic").isVisible(), false);
  await page.goto("about:blank");
  await page.goto(
    new URL(`#product=${id}&mode=map&time=${time}&camera=-120,-20,15000&place=-120.5,-20.5&tab=place`, base).href,
  );
  await journey.until(() => window.fluxglobe?.ready === true);
  const state = await journey.state();
  assert.equal(state.timeMs, Date.parse(time));
  assert.ok(Math.abs(state.camera.lon + 120) < 0.1 && Math.abs(state.camera.heightKm - 15000) < 10);
  await page.locator("#series-plot canvas").waitFor();
  await page.locator("#synthetic").filter({ hasText: /synthetic/i }).waitFor({ state: "visible" });
  await journey.shot("synthetic");
}

/** An address that asks for an instant that there is nothing of. */
export async function timeOutside(journey) {
  const { page, base } = journey;
  const { product: id, steps } = await journey.product();
  const last = steps[steps.length - 1].end;
  await page.goto("about:blank");
  await page.goto(new URL(`#product=${id}&mode=map&time=2150-07-01`, base).href);
  await journey.until(() => window.fluxglobe?.ready === true);
  const notice = page.locator('.notice[data-key="outside"]', { hasText: "1 Jul 2150" });
  await notice.waitFor();
  await journey.until((iso) => window.fluxglobe.shown?.endsWith(iso), last);
  await journey.shot("outside");
  // A new wish is a new chance.
  await page.locator("#time").press("Home");
  await notice.waitFor({ state: "detached" });
}

export async function refusedTiles(journey) {
  const { page } = journey;
  const reason = "planted: the render worker is away";
  await page.route("**/tiles/**/*.png?*", (route) => route.fulfill({ status: 503, json: { error: reason } }));
  await page.locator("#time").press("PageUp");
  await page.locator(".notice", { hasText: reason }).waitFor();
  await journey.shot("refused");
}

export async function lostServer(journey) {
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
