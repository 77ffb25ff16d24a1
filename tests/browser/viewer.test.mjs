//! The viewer in a real browser against a running server: FLUXGLOBE_URL in, checks and (with FLUXGLOBE_SCREENSHOTS) pictures out.
import assert from "node:assert/strict";
import test from "node:test";
import { budgetTotal, checkTable, landHasNoData, seriesOfSea, typedPlaceIsTurnedTo } from "./analysis-steps.mjs";
import { keepsTiles } from "./cache-steps.mjs";
import { filmIsRefused, filmIsSaved, largePictureIsCancelled } from "./film-steps.mjs";
import {
  globesAgree,
  keysTilt,
  liveIsSwitchedOff,
  opensInFlight,
  pictureFollowsCamera,
  pictureFollowsLook,
  pictureFollowsTime,
  staysWithTiles,
} from "./fly-steps.mjs";
import { testHarness } from "./harness-self.mjs";
import { openBrowser, Watch } from "./harness.mjs";
import { Journey, LIMIT_MS } from "./journey.mjs";
import { legendHasUnit, loads, phoneReachesAll, plays, renderedView, sliderMoves, tilesArrive, volumeMode } from "./layer-steps.mjs";
import {
  addressKeepsLook,
  legendWaitsForPicture,
  logIsOfferedAboveZero,
  lookIsAsked,
  lookIsReset,
  palettesAndReliefsAreOffered,
  playbackAndViewFollowLook,
  wrongLookIsIgnored,
} from "./look-steps.mjs";
import { pausesOnSteps, scrubsStream, scrubsTiles } from "./scrub-steps.mjs";
import { newDataIsShown, newDataLands, observationsOfPlatform } from "./stream-steps.mjs";
import { lostServer, refusedTiles, sharedAddress, timeOutside } from "./trouble-steps.mjs";

const URL_ASKED = process.env.FLUXGLOBE_URL;
/** Set where the server has all that the page can show: then a step that found nothing to look at has failed. */
const LOOKS_AT_ALL = process.env.FLUXGLOBE_LOOK_AT_ALL === "1";

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
    t.test(sentence, async (test) => {
      const startedMs = Date.now();
      try {
        assert.ok(journey.hasLoaded || act === loads, "the page never loaded, so there is nothing to look at");
        const skipped = await act(journey);
        assert.ok(!skipped || !LOOKS_AT_ALL, `nothing was looked at: ${skipped}`);
        if (skipped) test.diagnostic(`not looked at: ${skipped}`);
        // Attributed to the step during which it happened; the last check of all looks at the whole list again.
        if (isCleanPage) assert.deepEqual(watch.problems, [], "the page must stay without error");
      } catch (error) {
        await journey.shot(`failed-${sentence.replace(/\W+/g, "-")}`);
        throw plain(error, watch);
      } finally {
        if (process.env.FLUXGLOBE_TIMES)
          console.error(`${((Date.now() - startedMs) / 1000).toFixed(1)} s  ${sentence}`);
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
    await step("turns the globe to a typed place that is out of sight", typedPlaceIsTurnedTo);
    await step("shows the server's own budget total", budgetTotal);
    await step("shows the check table", checkTable);
    await step("plots what a platform that is clicked measured", observationsOfPlatform);
    await step("fetches volume tiles in volume mode", volumeMode);
    await step("shows the rendered view in a dialog", renderedView);
    await step("reaches all of the layer card on a phone", phoneReachesAll);
    await step("saves a film of the view that plays", filmIsSaved);
    await step("stops a film that is cancelled, and says what is wrong with one that cannot be", filmIsRefused);
    await step("shows that a large picture is on its way, and lets it be cancelled", largePictureIsCancelled);
    await step("offers palettes and reliefs", palettesAndReliefsAreOffered);
    await step("offers a logarithmic scale where the range lies above 0", logIsOfferedAboveZero);
    await step("draws tiles and legend in a palette and a range that are chosen", lookIsAsked);
    await step("keeps the legend of the picture in sight until the next one is there", legendWaitsForPicture);
    await step("keeps the look in its address", addressKeepsLook);
    await step("plays and renders views in the look", playbackAndViewFollowLook);
    await step("goes back to the usual look", lookIsReset);
    await step("passes over what an address asks of the look and is not there", wrongLookIsIgnored);
    await step("opens in flight: over a coast, with the live picture over the globe", opensInFlight);
    await step("shows the picture that the camera sees, and the full one when it rests", pictureFollowsCamera);
    await step("tilts and turns the camera by keys", keysTilt);
    await step("moves the picture with the look, and the legend with the picture", pictureFollowsLook);
    await step("runs time through the stream", pictureFollowsTime);
    await step("asks for no tile twice", keepsTiles);
    await step("pauses on stored steps, and steps from one to the next", pausesOnSteps);
    await step("shows tiles of one instant after the other while time is dragged", scrubsTiles);
    await step("shows live pictures without a hole while time is dragged", scrubsStream);
    await step("puts places where the picture has them", globesAgree);
    await step("goes back to tiles when the live picture is switched off", liveIsSwitchedOff);
    await step("stays with tiles where there is no stream", staysWithTiles);
    await step("shows data that lands while it is open", newDataLands);
    await step("says so when its address asks for a time that there is nothing of", timeOutside);
    await step("has nothing to complain about at the end", async () => {});
    // From here on errors are planted, so the clean list is no longer asked for.
    const planted = { isCleanPage: false };
    await step("asks for pictures again when it is told of new data", newDataIsShown, planted);
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
  const complaints =
    watch.problems.length > 0 && !text.includes("must stay without error")
      ? `\nThe page said:\n${watch.problems.join("\n")}`
      : "";
  return new Error(text + complaints);
}
