//! A headless browser for tests: an address in, a page out whose console errors, failed requests and foreign addresses are all written down.
import { accessSync, constants, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { delimiter, join } from "node:path";
import { chromium } from "playwright-core";

const NAMES = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/** WebGL is drawn by the processor, and nothing of the browser's own goes out to the network. */
const FLAGS = [
  "--headless=new",
  "--no-sandbox",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];

function browserPath() {
  const asked = process.env.FLUXGLOBE_CHROMIUM;
  if (asked) return asked;
  for (const folder of (process.env.PATH ?? "").split(delimiter)) {
    for (const name of NAMES) {
      const path = join(folder, name);
      try {
        accessSync(path, constants.X_OK);
        return path;
      } catch {
        // Not here; the next folder may have it.
      }
    }
  }
  throw new Error(`no browser found: none of ${NAMES.join(", ")} is in PATH, and FLUXGLOBE_CHROMIUM is not set`);
}

export async function openBrowser(viewport = { width: 1280, height: 800 }) {
  const profile = mkdtempSync(join(tmpdir(), "fluxglobe-browser-"));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath: browserPath(),
    headless: true,
    viewport,
    args: FLAGS,
  });
  return {
    context,
    async close() {
      await context.close();
      rmSync(profile, { recursive: true, force: true });
    },
  };
}

/** What went wrong on a page, one line each, and every answered request. */
export class Watch {
  problems = [];
  responses = [];

  constructor(context, ownOrigin) {
    context.on("console", (message) => {
      if (message.type() === "error") this.problems.push(`console error: ${message.text()}`);
    });
    context.on("weberror", (error) => this.problems.push(`page error: ${error.error().message}`));
    context.on("request", (request) => {
      const { origin, protocol } = new URL(request.url());
      if (protocol !== "data:" && protocol !== "blob:" && origin !== ownOrigin)
        this.problems.push(`request to another origin: ${request.url()}`);
    });
    context.on("requestfailed", (request) => {
      // The page itself calls off requests whose answer nobody waits for any more; those are no failures.
      const reason = request.failure()?.errorText ?? "unknown";
      if (reason !== "net::ERR_ABORTED") this.problems.push(`request failed: ${request.url()} (${reason})`);
    });
    context.on("response", (response) => {
      this.responses.push(response);
      if (response.status() >= 400) this.problems.push(`status ${response.status()}: ${response.url()}`);
    });
  }

  /** Tiles answered since `from`, an index into `responses`. */
  tiles(mode, from = 0) {
    return this.responses
      .slice(from)
      .filter(
        (response) => new URL(response.url()).pathname.includes(`/${mode}/`) && response.url().includes(".png?time="),
      );
  }
}

/** How many pixels of a picture are not wholly transparent, counted by the browser that shows it. */
export function visiblePixels(page, url) {
  return page.evaluate(async (address) => {
    const blob = await (await fetch(address)).blob();
    const bitmap = await createImageBitmap(blob);
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d");
    context.drawImage(bitmap, 0, 0);
    return countVisible(context.getImageData(0, 0, bitmap.width, bitmap.height).data);

    function countVisible(rgba) {
      let count = 0;
      for (let i = 3; i < rgba.length; i += 4) if (rgba[i] > 0) count += 1;
      return count;
    }
  }, url);
}
