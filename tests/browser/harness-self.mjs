//! Tests of the harness itself: a page that does wrong must be reported, and a page that does right must not.
import assert from "node:assert/strict";
import { createServer } from "node:http";
import { openBrowser, visiblePixels, Watch } from "./harness.mjs";

const SETTLE_LIMIT_MS = 15_000;

const PAGES = {
  "/clean": "<title>clean</title><link rel=icon href=data:,><p>nothing wrong here",
  "/console":
    "<title>console</title><link rel=icon href=data:,><script>console.error('planted: the page complains')</script>",
  "/throws":
    "<title>throws</title><link rel=icon href=data:,><script>setTimeout(() => { throw new Error('planted: thrown') })</script>",
  "/missing": "<title>missing</title><link rel=icon href=data:,><img src=/no-such-picture.png>",
};

function serve(answer) {
  return new Promise((resolve) => {
    const server = createServer(answer);
    server.listen(0, "127.0.0.1", () => resolve({ server, origin: `http://127.0.0.1:${server.address().port}` }));
  });
}

/** Adds the harness' own tests to `t`. */
export async function testHarness(t) {
  let foreignHits = 0;
  const foreign = await serve((_request, response) => {
    foreignHits += 1;
    response.end();
  });
  const own = await serve((request, response) => {
    const html =
      request.url === "/foreign"
        ? `<title>foreign</title><link rel=icon href=data:,><img src="${foreign.origin}/pixel.png">`
        : PAGES[request.url];
    response.writeHead(html ? 200 : 404, { "content-type": "text/html" });
    response.end(html ?? "");
  });
  const browser = await openBrowser({ width: 320, height: 240 });
  const watch = new Watch(browser.context, own.origin);
  const page = browser.context.pages()[0] ?? (await browser.context.newPage());
  const visit = async (path, expected) => {
    const before = watch.problems.length;
    await page.goto(own.origin + path);
    await waitFor(
      () => expected === undefined || watch.problems.slice(before).some((line) => expected.test(line)),
      `${path} to be reported as ${expected}`,
    );
    return watch.problems.slice(before);
  };

  try {
    await t.test("a page without fault is reported clean", async () => {
      assert.deepEqual(await visit("/clean"), []);
    });
    await t.test("a console error is reported", () => visit("/console", /console error: planted: the page complains/));
    await t.test("a thrown error is reported", () => visit("/throws", /page error: planted: thrown/));
    await t.test("a missing file is reported", () => visit("/missing", /status 404: .*no-such-picture/));
    await t.test("a request to another origin is reported, and did happen", async () => {
      await visit("/foreign", /request to another origin: .*pixel\.png/);
      await waitFor(() => foreignHits > 0, "the foreign server to be asked");
    });
    await t.test("an empty picture counts no visible pixel, a drawn one counts its own", async () => {
      assert.equal(await visiblePixels(page, await picture(page, 0)), 0);
      assert.equal(await visiblePixels(page, await picture(page, 7)), 7);
    });
  } finally {
    await browser.close();
    own.server.close();
    foreign.server.close();
  }
}

/** A 16 x 16 PNG of which `count` pixels are drawn. */
function picture(page, count) {
  return page.evaluate((pixels) => {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 16;
    for (let i = 0; i < pixels; i++) canvas.getContext("2d").fillRect(i, 3, 1, 1);
    return canvas.toDataURL("image/png");
  }, count);
}

async function waitFor(condition, what) {
  const limit = Date.now() + SETTLE_LIMIT_MS;
  while (!condition()) {
    if (Date.now() > limit) throw new Error(`waited ${SETTLE_LIMIT_MS} ms for ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
}
