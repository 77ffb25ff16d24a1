//! A line for the curious: how fast pictures or tiles come, how late they are, what is in sight and how smooth the page is; the key f shows and hides it.
import { el } from "../page/dom";
import { numberText } from "../page/format";
import type { Picture } from "./picture";
import { median, type Rate } from "./rate";

const EVERY_MS = 250;
/** The middle one of so many frames of the screen is told. */
const FRAMES = 60;

/** What the line tells of. */
export interface Shown {
  readonly rate: Rate;
  /** The live picture in sight. */
  picture: () => Picture | undefined;
  /** The tiles in sight where there is none. */
  tiles: () => { tiles: number; tookMs: number } | undefined;
}

export class Readout {
  readonly #line = el("output", { class: "readout", id: "readout", hidden: true, "aria-label": "How pictures come" });
  readonly #shown: Shown;
  #framesMs: number[] = [];

  constructor(container: HTMLElement, shown: Shown) {
    this.#shown = shown;
    container.append(this.#line);
    let timer: ReturnType<typeof setInterval> | undefined;
    window.addEventListener("keydown", (event) => {
      if (event.key !== "f" || event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
      this.#line.hidden = !this.#line.hidden;
      clearInterval(timer);
      if (this.#line.hidden) return;
      this.#watch();
      this.#write();
      timer = setInterval(() => this.#write(), EVERY_MS);
    });
  }

  #write(): void {
    const { rate, picture, tiles } = this.#shown;
    const frame = numberText(median(this.#framesMs), 0);
    this.#line.textContent = `${pictureText(rate, picture()) ?? tilesText(tiles())} · ${frame} ms a frame of the page`;
  }

  /** Frames of the screen, as long as somebody reads of them. */
  #watch(): void {
    this.#framesMs = [];
    let beforeMs: number | undefined;
    const next = (nowMs: number): void => {
      if (this.#line.hidden) return;
      if (beforeMs !== undefined) this.#framesMs = [...this.#framesMs, nowMs - beforeMs].slice(-FRAMES);
      beforeMs = nowMs;
      requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }
}

function pictureText(rate: Rate, picture: Picture | undefined): string | undefined {
  if (!picture) return undefined;
  const kind = picture.kind === "full" ? "full picture" : "while moving";
  const [perSecond, latency] = [numberText(rate.at(performance.now()), 1), numberText(rate.latencyMs, 0)];
  const bytes = numberText(picture.bytes.byteLength / 1024, 0);
  return `${perSecond} pictures/s · ${latency} ms from camera to screen (server ${numberText(picture.tookMs, 0)} ms) · ${kind}, ${picture.width} × ${picture.height}, ${bytes} kB`;
}

function tilesText(load: { tiles: number; tookMs: number } | undefined): string {
  return load ? `${load.tiles} tiles in ${numberText(load.tookMs, 0)} ms` : "No picture yet";
}

/** A letter typed into a field is no command. */
function isTyping(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && (target.isContentEditable || /^(input|select|textarea)$/i.test(target.tagName));
}
