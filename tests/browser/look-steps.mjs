//! Steps that change how the layer looks: what the panel offers, what is asked of the server, and what a link keeps.
import assert from "node:assert/strict";
import { isDeepStrictEqual } from "node:util";
import { LIMIT_MS } from "./journey.mjs";
import { eventually, number } from "./reading.mjs";

/** Answered requests since `from` whose path `pattern` fits, by their parameters. */
function queries(watch, from, pattern) {
  const urls = watch.responses.slice(from).map((response) => new URL(response.url()));
  return urls.filter((url) => pattern.test(url.pathname)).map((url) => Object.fromEntries(url.searchParams));
}

function colours({ palette, range, reverse }) {
  return { palette, range, reverse };
}

async function tick(journey, which) {
  return number(await journey.page.locator("#legend .legend-tick")[which]().innerText());
}

async function shownIs(journey, query) {
  await journey.until(
    (asked) => window.fluxglobe.shown?.includes(`?${asked}@`) && window.fluxglobe.tilesPending === 0,
    query,
  );
}

export async function palettesAndReliefsAreOffered(journey) {
  const { page } = journey;
  await page.locator("#tab-look").click();
  const { palettes } = await journey.api("api/palettes");
  const offered = page.locator('input[name="palette"]');
  assert.ok(palettes.length > 1);
  assert.deepEqual(
    await offered.evaluateAll((inputs) => inputs.map((input) => input.value)),
    palettes.map((palette) => palette.name),
  );
  // The one that is chosen at first is the product's own, and says so.
  const chosen = page.locator(".palette", { has: page.locator(":checked") });
  assert.match(await chosen.innerText(), /default/);
  const { legend } = await journey.product();
  const own = palettes.find((palette) => JSON.stringify(palette.stops) === JSON.stringify(legend.stops));
  assert.equal(await chosen.locator("input").inputValue(), own.name);
  const { products } = await journey.api("api/products");
  const elevations = products.filter((product) => product.quantity === "elevation").length;
  const relief = page.locator("#relief");
  assert.equal(await relief.locator("option").count(), elevations + 1);
  assert.equal(await relief.isDisabled(), elevations === 0);
  assert.equal(await page.locator("#relief-hint").isVisible(), elevations === 0);
}

/** A flux lies around 0: a logarithmic scale is no choice until a range above 0 is, and the page says why. */
export async function logIsOfferedAboveZero(journey) {
  const { page } = journey;
  const { legend } = await journey.product();
  if (legend.low > 0) return "the product's own range lies above 0";
  const isOffered = () => page.locator('#scale option[value="log"]').evaluate((option) => !option.disabled);
  assert.equal(await isOffered(), false);
  assert.match(await page.locator("#scale-hint").innerText(), /above 0/);
  await page.locator("#range-low").fill("0.5");
  await page.locator("#range-low").press("Enter");
  await page.locator("#scale-hint").waitFor({ state: "hidden" });
  assert.equal(await isOffered(), true);
  await page.locator("#scale").selectOption("log");
  await shownIs(journey, `range=0.5:${legend.high}&scale=log`);
  await page.locator("#range-low").fill("-1");
  await page.locator("#range-low").press("Enter");
  await page.locator("#range-problem", { hasText: "above 0" }).waitFor();
  await page.locator("#range-default").click();
  await journey.until(() => window.fluxglobe.state.look.range === null && window.fluxglobe.state.look.scale === null);
  await page.locator("#scale-hint", { hasText: "above 0" }).waitFor();
  await journey.until(() => window.fluxglobe.tilesPending === 0);
}

/** A palette other than the product's own, chosen with the keyboard; a range, of which a wrong one is refused first. */
export async function lookIsAsked(journey) {
  const { page, watch } = journey;
  const from = watch.responses.length;
  const before = await journey.shown();
  await page.locator('input[name="palette"]:checked').press("ArrowDown");
  const { palette } = (await journey.state()).look;
  assert.ok(palette);
  await shownIs(journey, `palette=${palette}`);
  assert.notEqual(await journey.shown(), before);

  const { legend } = await journey.product();
  await page.locator("#range-low").fill(String(legend.high + 1));
  await page.locator("#range-low").press("Enter");
  await page.locator("#range-problem", { hasText: "below" }).waitFor();
  assert.equal((await journey.state()).look.range, null, "a range that does not rise is not taken");
  await page.locator("#range-low").fill("-20");
  await page.locator("#range-low").press("Enter");
  await page.locator("#range-problem").waitFor({ state: "hidden" });
  await page.locator("#range-high").fill("20");
  await page.locator("#range-high").press("Enter");
  await shownIs(journey, `palette=${palette}&range=-20:20`);

  const { mode, product } = await journey.state();
  const wanted = { palette, range: "-20:20", reverse: undefined };
  const tiles = queries(watch, from, new RegExp(`/tiles/${product}/${mode}/`)).map(colours);
  assert.ok(
    tiles.some((query) => query.palette === palette && query.range === "-20:20"),
    "tiles of the look must have been fetched",
  );
  await eventually(async () => {
    // Of an answer that is on its way nothing is known yet.
    const legends = queries(watch, from, new RegExp(`/api/products/${product}/legend.json$`)).map(colours);
    // Answers to earlier looks may come after it; whose legend is shown, the ticks tell.
    assert.ok(
      legends.some((legend) => isDeepStrictEqual(legend, wanted)),
      JSON.stringify(legends),
    );
    assert.deepEqual([await tick(journey, "first"), await tick(journey, "last")], [-20, 20]);
  });
  await journey.shot("look");
}

/** A picture must not stay under the legend of another one: tiles are held back here, the new legend is not. */
export async function legendWaitsForPicture(journey) {
  const { page } = journey;
  const bar = () => page.locator("#legend .legend-bar").evaluate((element) => element.style.background);
  const before = { bar: await bar(), look: (await journey.state()).look };
  let release;
  const held = new Promise((resolve) => (release = resolve));
  const isReversed = (url) => url.searchParams.get("reverse") === "true";
  const isTile = (url) => /\/tiles\/.*\.png$/.test(url.pathname) && isReversed(url);
  await page.route(isTile, async (route) => {
    await held;
    await route.continue();
  });
  const legend = page.waitForResponse((answer) => /legend\.json/.test(answer.url()) && isReversed(new URL(answer.url())));
  await page.locator("#reversed").check();
  await legend;
  await journey.until(() => window.fluxglobe.tilesPending > 0);
  assert.equal(await bar(), before.bar);
  release();
  await shownIs(journey, `palette=${before.look.palette}&range=-20:20&reverse=true`);
  await eventually(async () => assert.notEqual(await bar(), before.bar));
  await page.unroute(isTile);
  await page.locator("#reversed").uncheck();
  await shownIs(journey, `palette=${before.look.palette}&range=-20:20`);
  await eventually(async () => assert.equal(await bar(), before.bar));
}

export async function addressKeepsLook(journey) {
  const { page, watch } = journey;
  const { look } = await journey.state();
  await eventually(() => assert.match(page.url(), new RegExp(`[#&]palette=${look.palette}&range=-20:20&.*tab=look`)));
  const from = watch.responses.length;
  await page.reload();
  await page.waitForFunction(() => window.fluxglobe?.ready === true, undefined, { timeout: LIMIT_MS });
  assert.deepEqual((await journey.state()).look, look);
  await shownIs(journey, `palette=${look.palette}&range=-20:20`);
  const { mode } = await journey.state();
  const tiles = queries(watch, from, new RegExp(`/tiles/[^/]+/${mode}/`));
  assert.ok(tiles.length > 0);
  for (const tile of tiles) assert.equal(tile.palette, look.palette, "no tile in other colours is asked for");
  assert.equal(await page.locator(`input[name="palette"][value="${look.palette}"]`).isChecked(), true);
  assert.equal(await page.locator("#range-low").inputValue(), "-20");
  await eventually(async () => assert.equal(await tick(journey, "first"), -20));
}

/** Pictures that load out of sight, and the server's own image of the view. */
export async function playbackAndViewFollowLook(journey) {
  const { page, watch } = journey;
  const { look, mode } = await journey.state();
  const wanted = { palette: look.palette, range: "-20:20", reverse: undefined };
  const from = watch.responses.length;
  const before = await journey.shown();
  await page.locator("#play").click();
  await journey.until((shown) => window.fluxglobe.shown !== shown, before);
  await page.locator("#play").click();
  await page.locator("#render-view").click();
  await page.locator("#view-image").waitFor();
  await page.keyboard.press("Escape");
  await journey.until(() => window.fluxglobe.tilesPending === 0);
  const tiles = queries(watch, from, new RegExp(`/tiles/[^/]+/${mode}/`));
  assert.ok(tiles.length > 0);
  const views = queries(watch, from, /\/globe\//);
  assert.equal(views.length, 1);
  for (const query of [...tiles, ...views]) assert.deepEqual(colours(query), wanted);
}

export async function lookIsReset(journey) {
  const { page } = journey;
  await page.locator("#coastlines").check();
  await shownIs(journey, "palette=" + (await journey.state()).look.palette + "&range=-20:20&coastlines=true");
  await page.locator("#look-reset").click();
  await journey.until(() => !window.fluxglobe.shown?.includes("?") && window.fluxglobe.tilesPending === 0);
  const { legend } = await journey.product();
  assert.equal(await page.locator("#range-low").inputValue(), String(legend.low));
  assert.equal(await page.locator("#coastlines").isChecked(), false);
  await eventually(() => assert.doesNotMatch(page.url(), /palette|range|coastlines/));
  await page.locator("#panels .quiet").first().click();
}

/** An address with a look of which this server knows only a part. */
export async function wrongLookIsIgnored(journey) {
  const { page, base } = journey;
  const { product } = await journey.state();
  await page.goto("about:blank");
  const wrong = "palette=nosuchpalette&range=5:1&relief=nothing-here&sea_opacity=7&sun=noon&coastlines=true";
  await page.goto(new URL(`#product=${product}&mode=map&${wrong}`, base).href);
  await journey.until(() => window.fluxglobe?.ready === true);
  await shownIs(journey, "coastlines=true");
  assert.equal(await page.locator(".notice").count(), 0, "nobody is told");
}
