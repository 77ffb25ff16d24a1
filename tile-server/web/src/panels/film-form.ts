//! "Save a film" of the rendered view: a period, a length and a rate in, frames asked for one by one, a WebM file out.
import { askedAgain } from "../api/again";
import { getPicture } from "../api/client";
import { type Coverage, daysOf, type FilmPlan, frameCount, instants, problemOf } from "../film/plan";
import { el, icon } from "../page/dom";
import { DOWNLOAD } from "../page/icons";

/** A view of which only the instant is open. */
export interface FilmView {
  readonly name: string;
  readonly width: number;
  readonly height: number;
  readonly coverage: Coverage;
  addressAt(timeMs: number): string;
}

const DAY_MS = 86_400_000;

export class FilmForm {
  readonly element: HTMLElement;
  readonly #view: () => FilmView | undefined;
  readonly #from = el("input", { type: "text", id: "film-from", "aria-label": "First day", placeholder: "YYYY-MM-DD" });
  readonly #to = el("input", { type: "text", id: "film-to", "aria-label": "Last day", placeholder: "YYYY-MM-DD" });
  readonly #seconds = number("film-seconds", "Seconds", "8");
  readonly #rate = number("film-rate", "Frames a second", "25");
  readonly #go = el("button", { type: "submit", id: "film-go" }, "Save a film");
  readonly #cancel = el("button", { type: "button", id: "film-cancel", hidden: true }, "Cancel");
  readonly #progress = el("progress", { id: "film-progress", max: "1", hidden: true });
  readonly #says = el("output", { id: "film-says", class: "muted" });
  readonly #save = el("a", { class: "button", id: "film-save", hidden: true }, icon(DOWNLOAD), "Save the film");
  /** The days that were offered last: whoever typed none of his own is offered those of another product. */
  #offered = ["", ""];
  #url: string | undefined;
  #making: AbortController | undefined;

  constructor(view: () => FilmView | undefined) {
    this.#view = view;
    this.element = el(
      "form",
      { class: "film-form" },
      el("label", { class: "field" }, el("span", {}, "From"), this.#from),
      el("label", { class: "field" }, el("span", {}, "To"), this.#to),
      el("label", { class: "field" }, el("span", {}, "Seconds"), this.#seconds),
      el("label", { class: "field" }, el("span", {}, "Frames a second"), this.#rate),
      this.#go,
      this.#cancel,
      this.#progress,
      this.#says,
      this.#save,
    );
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.#make();
    });
    this.#cancel.addEventListener("click", () => this.stop());
  }

  /** The period that a film shows unless another is typed. */
  offer(coverage: Coverage | undefined): void {
    const [first, last] = this.#offered;
    if (!coverage || this.#from.value !== first || this.#to.value !== last) return;
    this.#offered = daysOf(coverage);
    [this.#from.value, this.#to.value] = daysOf(coverage);
  }

  stop(): void {
    this.#making?.abort();
  }

  async #make(): Promise<void> {
    const plan = this.#plan();
    const view = this.#view();
    const problem = view ? problemOf(plan, view.coverage) : "There is nothing to film.";
    if (problem !== undefined || !view) {
      this.#tell(problem ?? "", true);
      return;
    }
    this.stop();
    const making = new AbortController();
    this.#making = making;
    this.#show(true);
    const times = instants(plan);
    const startedMs = performance.now();
    this.#tell("The server is drawing the first frame …");
    try {
      // A library that only films need comes with the first one.
      const { makeFilm } = await import("../film/film");
      const film = await makeFilm(
        { width: view.width, height: view.height, framesPerSecond: plan.framesPerSecond },
        times.length,
        (i) => askedAgain(() => getPicture(view.addressAt(times[i] ?? plan.endMs), making.signal), making.signal),
        (done) => {
          this.#progress.value = done / times.length;
          const leftS = ((performance.now() - startedMs) / 1000 / done) * (times.length - done);
          this.#tell(`${done} of ${times.length} frames, ${Math.ceil(leftS)} s left`);
        },
        making.signal,
      );
      this.#offerFilm(film, view.name);
      this.#tell(`${frameCount(plan)} frames, ${(film.size / 1e6).toFixed(1)} MB`);
    } catch (error) {
      if (making.signal.aborted) this.#tell("Cancelled.");
      else this.#tell(error instanceof Error ? error.message : String(error), true);
    } finally {
      this.#show(false);
    }
  }

  #plan(): FilmPlan {
    const day = (text: string) => (/^\d{4}-\d{2}-\d{2}$/.test(text.trim()) ? Date.parse(text.trim()) : Number.NaN);
    return {
      startMs: day(this.#from.value),
      // The last day is in the film.
      endMs: day(this.#to.value) + DAY_MS,
      seconds: Number(this.#seconds.value),
      framesPerSecond: Number(this.#rate.value),
    };
  }

  #show(isMaking: boolean): void {
    this.#go.disabled = isMaking;
    this.#cancel.hidden = !isMaking;
    this.#progress.hidden = !isMaking;
    if (isMaking) {
      this.#progress.value = 0;
      this.#save.hidden = true;
    }
  }

  #tell(text: string, isProblem = false): void {
    this.#says.textContent = text;
    this.#says.className = isProblem ? "problem" : "muted";
  }

  #offerFilm(film: Blob, name: string): void {
    if (this.#url) URL.revokeObjectURL(this.#url);
    this.#url = URL.createObjectURL(film);
    this.#save.href = this.#url;
    this.#save.download = `${name}.webm`;
    this.#save.hidden = false;
  }
}

function number(id: string, label: string, value: string): HTMLInputElement {
  return el("input", { type: "number", id, "aria-label": label, value, min: "1", step: "any" });
}
