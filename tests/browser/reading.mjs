//! Reading what the page shows: numbers and units from typeset text, ink from plots.
import assert from "node:assert/strict";
import { LIMIT_MS } from "./journey.mjs";

const PAUSE_MS = 50;

/** Canvas pixels that carry ink. */
function inkOf(page, selector) {
  return page
    .locator(selector)
    .first()
    .evaluate((canvas) => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      let count = 0;
      for (let i = 3; i < data.length; i += 4) if (data[i] > 0) count += 1;
      return count;
    });
}

/** A canvas is there before it is drawn on: waits until it carries more ink than axes alone. */
export function hasInk(page, selector) {
  return eventually(async () => {
    const ink = await inkOf(page, selector);
    assert.ok(ink > 500, `${selector} must have been drawn, it has ${ink} pixels of ink`);
  });
}

/** What the page shows follows what was done to it, but not at once: holds when `check` passes, fails as it failed last. */
export async function eventually(check) {
  const limit = Date.now() + LIMIT_MS;
  for (;;) {
    try {
      return await check();
    } catch (error) {
      if (Date.now() > limit) throw error;
    }
    await new Promise((resolve) => setTimeout(resolve, PAUSE_MS));
  }
}

export function iso(timeMs) {
  return `${new Date(timeMs).toISOString().slice(0, 19)}Z`;
}

/** A number as the page sets it: true minus sign, thin spaces. */
export function number(text) {
  return Number(text.replace(/\u2212/g, "-").replace(/[\s\u2009\u202f]/g, ""));
}

/** A unit without its typography, so that the page and the server can be compared. */
export function letters(text) {
  const plain = text.replace(/[⁰¹²³⁴⁵⁶⁷⁸⁹₂]/g, (sign) => ({ "₂": "2" })[sign] ?? String("⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(sign)));
  return plain
    .replace(/⁻/g, "-")
    .replace("°C", "degC")
    .replace(/[\s\u202f^*]/g, "");
}
