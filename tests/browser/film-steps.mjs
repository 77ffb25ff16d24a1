//! Large pictures and films of the rendered view: what is asked of the server, and what the film holds when the browser plays it.
import assert from "node:assert/strict";
import { LIMIT_MS } from "./journey.mjs";

/** Small and short: a processor draws it. */
const FRAMES = 12;
const RATE = 6;

async function openForm({ page }) {
  await page.locator("#render-view").click();
  await page.locator("#view-image").waitFor();
  await page.locator("#view-mode").selectOption("map");
  await page.locator("#view-image").waitFor();
  await page.locator("#film-from").fill("2000-01-01");
  await page.locator("#film-to").fill("2000-12-30");
  await page.locator("#film-seconds").fill(String(FRAMES / RATE));
  await page.locator("#film-rate").fill(String(RATE));
}

/** Requests for pictures of the globe while something is done, and how many were on their way at once. */
async function asked({ page }, act) {
  const times = [];
  let [onTheWay, most] = [0, 0];
  const isView = (request) => new URL(request.url()).pathname.startsWith("/globe/");
  const begins = (request) => {
    if (!isView(request)) return;
    times.push(new URL(request.url()).searchParams.get("time"));
    onTheWay += 1;
    most = Math.max(most, onTheWay);
  };
  const ends = (request) => {
    if (isView(request)) onTheWay -= 1;
  };
  page.on("request", begins).on("requestfinished", ends).on("requestfailed", ends);
  await act(times);
  page.off("request", begins).off("requestfinished", ends).off("requestfailed", ends);
  return { times, most };
}

export async function filmIsSaved(journey) {
  const { page } = journey;
  await openForm(journey);
  const { times, most } = await asked(journey, async () => {
    await page.locator("#film-go").click();
    await page.locator("#film-progress").waitFor();
    await page.getByText(new RegExp(`of ${FRAMES} frames`)).waitFor();
    await journey.shot("film");
    await page.locator("#film-save").waitFor({ timeout: LIMIT_MS });
  });
  assert.equal(times.length, FRAMES, "one picture a frame");
  assert.equal(new Set(times).size, FRAMES);
  assert.deepEqual([times[0], times.at(-1)], ["2000-01-01T00:00:00Z", "2000-12-31T00:00:00Z"]);
  assert.equal(most, 1, "one by one");
  assert.match(await page.locator("#film-save").getAttribute("download"), /takahashi09-flux-map\.webm/);
  const film = await inAnotherPage(page, await bytesOf(page));
  assert.equal(film.type, "video/webm");
  assert.deepEqual(film.signature, [0x1a, 0x45, 0xdf, 0xa3], "EBML (RFC 8794)");
  assert.ok(Math.abs(film.duration - FRAMES / RATE) < 0.02, `it lasts ${film.duration} s`);
  assert.equal(film.frames, FRAMES, "frames that the browser decoded");
  assert.deepEqual([film.width % 2, film.height % 2], [0, 0]);
  assert.ok(film.differ > 2, `the first and the last third differ by ${film.differ} levels`);
}

function bytesOf(page) {
  return page.evaluate(async () => {
    const blob = await (await fetch(document.querySelector("#film-save").href)).blob();
    const reader = new FileReader();
    reader.readAsDataURL(blob);
    await new Promise((resolve) => (reader.onload = resolve));
    return reader.result;
  });
}

/** The viewer's own page plays nothing: its policy has no media. */
async function inAnotherPage(page, film) {
  const player = await page.context().newPage();
  try {
    return await player.evaluate(played, film);
  } finally {
    await player.close();
    await page.bringToFront();
  }
}

/** Plays a film from the start to the end. */
async function played(film) {
  const blob = await (await fetch(film)).blob();
  const url = URL.createObjectURL(blob);
  const video = Object.assign(document.createElement("video"), { src: url, muted: true });
  await new Promise((resolve, reject) => {
    video.oncanplaythrough = resolve;
    video.onerror = () => reject(new Error(video.error.message));
  });
  const first = await pixelsAt(0.05);
  const later = await pixelsAt(video.duration * 0.6);
  const again = Object.assign(document.createElement("video"), { src: url, muted: true });
  await again.play();
  await new Promise((resolve) => (again.onended = resolve));
  return {
    type: blob.type,
    signature: [...new Uint8Array(await blob.slice(0, 4).arrayBuffer())],
    duration: video.duration,
    frames: again.getVideoPlaybackQuality().totalVideoFrames,
    width: video.videoWidth,
    height: video.videoHeight,
    differ: first.reduce((sum, value, i) => sum + Math.abs(value - later[i]), 0) / first.length,
  };

  async function pixelsAt(seconds) {
    video.currentTime = seconds;
    await new Promise((resolve) => (video.onseeked = resolve));
    const context = new OffscreenCanvas(video.videoWidth, video.videoHeight).getContext("2d");
    context.drawImage(video, 0, 0);
    return [...context.getImageData(0, 0, video.videoWidth, video.videoHeight).data];
  }
}

export async function filmIsRefused(journey) {
  const { page } = journey;
  const says = (text) => page.locator("#film-says").getByText(text).waitFor();
  await page.locator("#film-to").fill("1999-12-30");
  await page.locator("#film-go").click();
  await says("must come after");
  await page.locator("#film-to").fill("2000-12-30");
  await page.locator("#film-seconds").fill("600");
  const { times } = await asked(journey, async (times) => {
    await page.locator("#film-go").click();
    await page.getByText(/of 3600 frames/).waitFor();
    await page.locator("#film-cancel").click();
    await says("Cancelled.");
    const before = times.length;
    await page.waitForFunction(() => !document.querySelector("#film-go").disabled);
    assert.equal(times.length, before, "nothing more is asked");
  });
  assert.ok(times.length < 100 && (await page.locator("#film-save").isHidden()));
  const encoder = await page.evaluateHandle(() => window.VideoEncoder);
  await page.evaluate(() => delete window.VideoEncoder);
  await page.locator("#film-go").click();
  await says("cannot encode films");
  await page.evaluate((encoder) => (window.VideoEncoder = encoder), encoder);
}

export async function largePictureIsCancelled(journey) {
  const { page } = journey;
  const sizes = await page.locator("#view-size option").allTextContents();
  const [width, height] = sizes.at(-1).split(" × ").map(Number);
  assert.ok(width > 4096 && width <= 7680 && width * height <= 7680 * 4320 && width * height > 25e6, sizes.at(-1));
  await page.locator("#view-size").selectOption("7680");
  await page.locator("#view-progress").waitFor();
  await page.getByText(/drawing … \d+ s/).waitFor();
  await journey.shot("large-picture");
  await page.locator("#view-cancel").click();
  await page.locator(".view-frame").getByText("Cancelled.").waitFor();
  await page.locator("#view-size").selectOption("1024");
  await page.locator("#view-image").waitFor();
  await page.keyboard.press("Escape");
}
