//! A line for the curious: how fast pictures come, how late they are, and what the one in sight is; the key f shows and hides it.
import { el } from "../page/dom";
import { numberText } from "../page/format";
import type { Picture } from "./picture";
import type { Rate } from "./rate";

const EVERY_MS = 250;

export class Readout {
  readonly #line = el("output", { class: "readout", id: "readout", hidden: true, "aria-label": "How the live picture comes" });

  constructor(container: HTMLElement, rate: Rate, shown: () => Picture | undefined) {
    container.append(this.#line);
    let timer: ReturnType<typeof setInterval> | undefined;
    const write = (): void => {
      this.#line.textContent = textOf(rate, shown());
    };
    window.addEventListener("keydown", (event) => {
      if (event.key !== "f" || event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
      this.#line.hidden = !this.#line.hidden;
      clearInterval(timer);
      if (this.#line.hidden) return;
      write();
      timer = setInterval(write, EVERY_MS);
    });
  }
}

function textOf(rate: Rate, picture: Picture | undefined): string {
  if (!picture) return "No live picture.";
  const kind = picture.kind === "full" ? "full picture" : "while moving";
  const [perSecond, latency] = [numberText(rate.at(performance.now()), 1), numberText(rate.latencyMs, 0)];
  const bytes = numberText(picture.bytes.byteLength / 1024, 0);
  return `${perSecond} pictures/s · ${latency} ms from camera to screen (server ${numberText(picture.tookMs, 0)} ms) · ${kind}, ${picture.width} × ${picture.height}, ${bytes} kB`;
}

/** A letter typed into a field is no command. */
function isTyping(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && (target.isContentEditable || /^(input|select|textarea)$/i.test(target.tagName));
}
