//! The time bar: a slider over the product's whole range with play, single steps and speed; continuous while it is dragged.
import { el, icon } from "../page/dom";
import { BACK, FORWARD, PAUSE, PLAY } from "../page/icons";
import type { Store } from "../state/store";
import {
  clampToRange,
  formatInstant,
  instantAt,
  labelledEvery,
  PARTS_PER_STEP,
  positionOf,
  quantise,
  type Step,
  stepBeside,
  stepLabel,
} from "./steps";

const SPEEDS = [0.25, 0.5, 1, 2, 4];
/** Labels under the slider stay apart by at least this, and by so much a letter. */
const LABEL_WIDTH_PX = 64;
const LETTER_WIDTH_PX = 6.4;

export class Timeline {
  readonly #store: Store;
  readonly #isFollowed: () => boolean;
  #steps: readonly Step[] = [];
  readonly #slider = el("input", {
    type: "range",
    id: "time",
    min: "0",
    max: "1",
    step: "any",
    value: "0",
    "aria-label": "Time",
  });
  readonly #readout = el("output", { class: "time-readout", id: "time-readout", for: "time" });
  readonly #play = el("button", { type: "button", class: "round play", id: "play" });
  readonly #ticks = el("div", { class: "ticks", "aria-hidden": "true" });

  /** `isFollowed`: pictures of any instant come by themselves. */
  constructor(container: HTMLElement, store: Store, isFollowed: () => boolean) {
    this.#store = store;
    this.#isFollowed = isFollowed;
    const speed = el("select", { id: "speed", "aria-label": "Playback speed in steps per second" });
    for (const pace of SPEEDS)
      speed.append(el("option", { value: String(pace), selected: pace === store.state.stepsPerSecond }, `${pace}×`));
    speed.addEventListener("change", () => store.set({ stepsPerSecond: Number(speed.value) }));
    container.append(
      el(
        "div",
        { class: "transport" },
        el(
          "button",
          {
            type: "button",
            class: "round",
            id: "step-back",
            "aria-label": "One step back",
            onclick: () => this.#jump(-1),
          },
          icon(BACK),
        ),
        this.#play,
        el(
          "button",
          {
            type: "button",
            class: "round",
            id: "step-forward",
            "aria-label": "One step forward",
            onclick: () => this.#jump(1),
          },
          icon(FORWARD),
        ),
      ),
      el("div", { class: "track" }, this.#slider, this.#ticks),
      el(
        "div",
        { class: "time-side" },
        this.#readout,
        el("label", { class: "speed" }, el("span", { class: "visually-hidden" }, "Speed"), speed),
      ),
    );
    this.#play.addEventListener("click", () => store.set({ playing: !store.state.playing }));
    // While the thumb moves, instants are taken on the cached raster; where it is let go, exactly what was chosen.
    const exactMs = () => Math.round(this.#chosenMs() / 1000) * 1000;
    this.#slider.addEventListener("input", () =>
      store.set({ timeMs: this.#isFollowed() ? exactMs() : quantise(this.#steps, this.#chosenMs()) }),
    );
    this.#slider.addEventListener("change", () => store.set({ timeMs: exactMs() }));
    this.#slider.addEventListener("keydown", (event) => this.#key(event));
    new ResizeObserver(() => this.#drawTicks()).observe(this.#ticks);
    new ResizeObserver(() =>
      document.documentElement.style.setProperty("--timeline", `${container.offsetHeight}px`),
    ).observe(container);
    store.on(["timeMs"], () => this.#drawTime());
    store.on(["playing"], () => this.#drawPlay());
    this.#drawPlay();
  }

  setSteps(steps: readonly Step[]): void {
    this.#steps = steps;
    this.#slider.max = String(steps.length);
    this.#drawTicks();
    this.#drawTime();
  }

  /** The slider runs over step positions, so that every step has the same width whatever its length. */
  #chosenMs(): number {
    return instantAt(this.#steps, Number(this.#slider.value));
  }

  /** To the stored step beside the instant, and from the last one to the first; who steps looks at it, so playback pauses. */
  #jump(direction: 1 | -1): void {
    const [first, last] = [this.#steps[0], this.#steps.at(-1)];
    if (!first || !last) return;
    const beyond = direction > 0 ? first.atMs : last.atMs;
    this.#stepTo(stepBeside(this.#steps, this.#store.state.timeMs, direction) ?? beyond);
  }

  #stepTo(timeMs: number): void {
    this.#store.set({ timeMs, playing: false });
  }

  #key(event: KeyboardEvent): void {
    const moves: Record<string, number> = {
      ArrowLeft: -1 / PARTS_PER_STEP,
      ArrowDown: -1 / PARTS_PER_STEP,
      ArrowRight: 1 / PARTS_PER_STEP,
      ArrowUp: 1 / PARTS_PER_STEP,
      Home: -Infinity,
      End: Infinity,
    };
    const steps: Record<string, 1 | -1> = { PageDown: -1, PageUp: 1 };
    const [move, step] = [moves[event.key], steps[event.key]];
    if (move === undefined && step === undefined) return;
    event.preventDefault();
    const { timeMs } = this.#store.state;
    if (step !== undefined) this.#stepTo(stepBeside(this.#steps, timeMs, step) ?? timeMs);
    if (move === undefined) return;
    const position = Math.min(
      Math.max(positionOf(this.#steps, timeMs) + move, 0),
      this.#steps.length,
    );
    this.#store.set({ timeMs: clampToRange(this.#steps, quantise(this.#steps, instantAt(this.#steps, position))) });
  }

  #drawTime(): void {
    const { timeMs } = this.#store.state;
    if (!Number.isFinite(timeMs)) return;
    const position = positionOf(this.#steps, timeMs);
    // The thumb under the reader's finger is left where it is, unless it is elsewhere altogether.
    const isElsewhere = Math.abs(Number(this.#slider.value) - position) > 0.5 / PARTS_PER_STEP;
    if (isElsewhere || (this.#isFollowed() && !this.#slider.matches(":active"))) this.#slider.value = String(position);
    this.#slider.style.setProperty("--part", String(position / Math.max(1, this.#steps.length)));
    const text = formatInstant(timeMs);
    this.#readout.textContent = text;
    this.#slider.setAttribute("aria-valuetext", text);
  }

  #drawPlay(): void {
    const { playing } = this.#store.state;
    this.#play.replaceChildren(icon(playing ? PAUSE : PLAY));
    this.#play.setAttribute("aria-label", playing ? "Pause" : "Play");
    this.#play.setAttribute("aria-pressed", String(playing));
  }

  #drawTicks(): void {
    const count = this.#steps.length;
    const width = this.#ticks.clientWidth;
    if (count === 0 || width === 0) return;
    const labels = this.#steps.map(stepLabel);
    const longest = labels.reduce((most, { length }) => Math.max(most, length), 0);
    const labelWidth = Math.max(LABEL_WIDTH_PX, longest * LETTER_WIDTH_PX);
    const every = labelledEvery(Math.ceil(count / Math.max(1, Math.floor(width / labelWidth))), this.#steps);
    this.#ticks.replaceChildren();
    labels.forEach((label, index) => {
      const isLabelled = index % every === 0;
      if (!isLabelled && count > 60) return;
      const tick = el("span", { class: isLabelled ? "tick labelled" : "tick" }, isLabelled ? label : null);
      tick.style.left = `${((index + 0.5) / count) * 100}%`;
      this.#ticks.append(tick);
    });
  }
}
