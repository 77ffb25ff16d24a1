//! One reader's way through the page: what a step needs to look at, ask the server and wait for.
import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { join } from "node:path";

const SCREENSHOTS = process.env.FLUXGLOBE_SCREENSHOTS;
/** A processor that draws the globe and the tiles and builds something else besides is slow, not broken. */
export const LIMIT_MS = Number(process.env.FLUXGLOBE_LIMIT_MS ?? 60_000);

export class Journey {
  hasLoaded = false;

  constructor(page, watch, base) {
    Object.assign(this, { page, watch, base });
  }

  state() {
    return this.page.evaluate(() => window.fluxglobe.state);
  }

  shown() {
    return this.page.evaluate(() => window.fluxglobe.shown ?? "");
  }

  until(condition, argument) {
    return this.page.waitForFunction(condition, argument, { timeout: LIMIT_MS });
  }

  async api(path, query = {}) {
    const url = new URL(path, this.base);
    for (const [key, value] of Object.entries(query)) url.searchParams.set(key, value);
    const answer = await fetch(url);
    assert.equal(answer.status, 200, `${url} must answer 200`);
    return answer.json();
  }

  /** The product on show, as the server describes it. */
  async product() {
    const { product } = await this.state();
    return (await this.api("api/products")).products.find((each) => each.product === product);
  }

  async shot(name) {
    if (!SCREENSHOTS) return;
    mkdirSync(SCREENSHOTS, { recursive: true });
    await this.page.screenshot({ path: join(SCREENSHOTS, `${name}.png`) });
  }
}
