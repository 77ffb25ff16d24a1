//! Messages to the reader: what went wrong, in words, with a way to close it; the same message twice is shown once.
import { byId, el, icon } from "./dom";
import { CLOSE } from "./icons";

/** More would cover the globe; the oldest goes first. */
const MOST_SHOWN = 3;
/** Long enough to be read twice. */
const NEWS_MS = 20_000;

export class Notices {
  readonly #box = byId("notices");
  readonly #shown = new Map<string, HTMLElement>();

  /** `key` tells which message replaces which: a repeated failure of one kind is one notice. */
  show(key: string, text: string, kind: "trouble" | "news" = "trouble"): void {
    const known = this.#shown.get(key);
    if (known) {
      const line = known.querySelector("span");
      if (line && line.textContent !== text) line.textContent = text;
      return;
    }
    const close = el(
      "button",
      { type: "button", class: "quiet", "aria-label": "Close this message", onclick: () => this.clear(key) },
      icon(CLOSE),
    );
    const notice = el("div", { class: `notice ${kind}`, "data-key": key }, el("span", {}, text), close);
    this.#shown.set(key, notice);
    this.#box.append(notice);
    const oldest = this.#shown.keys().next().value;
    if (this.#shown.size > MOST_SHOWN && oldest !== undefined) this.clear(oldest);
  }

  /** News that nobody has to close. */
  tell(key: string, text: string): void {
    this.clear(key);
    this.show(key, text, "news");
    const shown = this.#shown.get(key);
    setTimeout(() => {
      if (this.#shown.get(key) === shown) this.clear(key);
    }, NEWS_MS);
  }

  clear(key: string): void {
    this.#shown.get(key)?.remove();
    this.#shown.delete(key);
  }
}
