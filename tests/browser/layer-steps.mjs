//! Steps that watch the layer: it loads, has a legend, moves in time, plays, and changes its mode.
import assert from "node:assert/strict";
import { visiblePixels } from "./harness.mjs";
import { LIMIT_MS } from "./journey.mjs";
import { eventually, iso, letters } from "./reading.mjs";

export async function loads(journey) {
  const { page, base } = journey;
  // These steps look at tiles; those of the live picture fly by themselves.
  const answer = await page.goto(new URL("#live=off", base).href);
  assert.equal(answer.status(), 200);
  await page.waitForFunction(() => window.fluxglobe?.ready === true, undefined, { timeout: LIMIT_MS });
  assert.ok(await page.locator("#globe canvas").isVisible());
  journey.hasLoaded = true;
}

export async function tilesArrive(journey) {
  const { mode } = await journey.state();
  await journey.until(() => window.fluxglobe.tilesLoaded > 0 && window.fluxglobe.tilesPending === 0);
  const counts = await journey.page.evaluate(() => ({
    loaded: window.fluxglobe.tilesLoaded,
    failed: window.fluxglobe.tilesFailed,
  }));
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

export async function legendHasUnit(journey) {
  const { legend } = await journey.product();
  assert.notEqual(letters(legend.unit), "");
  await eventually(async () => {
    const text = await journey.page.locator("#legend .legend-unit").innerText();
    // Typography differs (superscripts, thin spaces), letters and figures do not.
    assert.equal(letters(text), letters(legend.unit));
    assert.ok((await journey.page.locator("#legend .legend-tick").count()) >= 2);
  });
}

export async function sliderMoves(journey) {
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
  assert.ok(
    Math.abs((after.timeMs - start) / (end - start) - 0.53) < 0.1,
    "the instant must be where the thumb was let go",
  );
  await journey.until((iso) => window.fluxglobe.shown?.endsWith(iso), iso(after.timeMs));
  const times = new Set(
    watch.tiles(after.mode, before.responses).map((tile) => new URL(tile.url()).searchParams.get("time")),
  );
  assert.ok(
    times.has(iso(after.timeMs)),
    `tiles of ${iso(after.timeMs)} must have been fetched, not only of ${[...times]}`,
  );
  assert.ok(!times.has(iso(before.state.timeMs)));
  await page.locator("#time").press("Home");
  await eventually(async () => assert.equal((await journey.state()).timeMs, start, "Home goes to the start"));
}

export async function plays(journey) {
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
  await journey.until(() => window.fluxglobe.state.playing === false);
  const after = await journey.state();
  assert.ok(after.timeMs > before.timeMs, "time must have gone on");
}

/** A phone's layer card has a button for what it has no room for, and it ends above the time bar. */
export async function phoneReachesAll(journey) {
  const { page } = journey;
  const wide = page.viewportSize();
  const rest = ["#opacity", "#render-view", ".controls .source"];
  assert.equal(await page.locator("#more").isVisible(), false, "a wide window shows all of it");
  await page.setViewportSize({ width: 390, height: 844 });
  for (const part of rest) await page.locator(part).waitFor({ state: "hidden" });
  await page.locator("#more").click();
  for (const part of rest) await page.locator(part).waitFor();
  const [card, bar] = [await page.locator("#controls").boundingBox(), await page.locator("#timeline").boundingBox()];
  assert.ok(card.y + card.height <= bar.y, "the card must not cover the time bar");
  await journey.shot("phone");
  await page.locator("#render-view").click();
  await page.locator("#view-image").waitFor();
  await page.keyboard.press("Escape");
  await page.locator("#more").click();
  for (const part of rest) await page.locator(part).waitFor({ state: "hidden" });
  await page.setViewportSize(wide);
  await journey.until(() => window.fluxglobe.tilesPending === 0);
}

export async function volumeMode(journey) {
  const { page, watch } = journey;
  const from = watch.responses.length;
  await page.locator('button[data-mode="volume"]').click();
  await journey.until(() => window.fluxglobe.shown?.includes("/volume@") && window.fluxglobe.tilesPending === 0);
  await assertTilesVisible(journey, watch.tiles("volume", from));
  await journey.shot("volume");
}

export async function renderedView(journey) {
  const { page } = journey;
  await page.locator("#render-view").click();
  await page.locator("#view-image").waitFor();
  const source = await page.locator("#view-image").getAttribute("src");
  assert.ok((await visiblePixels(page, source)) > 1000, "the image must show the globe");
  await eventually(() =>
    assert.ok(
      journey.watch.responses.some(
        (response) => /\/globe\/.*\/volume\.png/.test(response.url()) && response.status() === 200,
      ),
      "the server must have drawn it",
    ),
  );
  await journey.shot("view");
  await page.keyboard.press("Escape");
}
