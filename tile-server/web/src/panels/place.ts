//! The place panel: a chosen point in, its series as a plot with the value at the present instant out; a place can be typed as well.
import { ApiError } from "../api/client";
import * as api from "../api/requests";
import type { PointSeries } from "../api/types";
import { type Bounds, contains } from "../globe/box";
import { el, icon, saveText } from "../page/dom";
import { chemistry, latText, lonText, unitText, valueText } from "../page/format";
import { DOWNLOAD } from "../page/icons";
import type { Place } from "../state/camera";
import { holdsAt, isLinear } from "../state/catalogue";
import type { Store } from "../state/store";
import { clampToRange, formatInstant, parseSteps, quantise, rangeOf, type Step } from "../time/steps";
import { type Chart, seriesChart } from "./chart";
import { seriesCsv } from "./csv";
import { manifestLine } from "./manifest";
import { hasData, heldAt, heldSamplesOf, missingText, type Sample, samplesOf, valueAt } from "./series";

export interface PlaceContext {
  store: Store;
  steps: () => readonly Step[];
  label: () => string;
  bounds: () => Bounds | undefined;
  /** Somebody typed a place, which may lie on the far side. */
  bringIntoSight: (place: Place) => void;
  onError: (key: string, error: unknown) => void;
}

export class PlacePanel {
  readonly #context: PlaceContext;
  readonly #content = el("div", { class: "place-content", "aria-live": "polite" });
  readonly #lat = el("input", { type: "number", id: "place-lat", min: "-90", max: "90", step: "any" });
  readonly #lon = el("input", { type: "number", id: "place-lon", min: "-180", max: "360", step: "any" });
  #asked: AbortController | undefined;
  #shown:
    | {
        samples: Sample[];
        isBlended: boolean;
        unit: string;
        chart: Chart | undefined;
        value: HTMLElement;
        when: HTMLElement;
        missing: HTMLElement;
      }
    | undefined;

  constructor(body: HTMLElement, context: PlaceContext) {
    this.#context = context;
    const form = el(
      "form",
      { class: "row typed place-form" },
      el("label", { class: "field" }, el("span", {}, "Latitude, ° N"), this.#lat),
      el("label", { class: "field" }, el("span", {}, "Longitude, ° E"), this.#lon),
      el("button", { type: "submit" }, "Go"),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.#lat.value === "" || this.#lon.value === "") return;
      const place = { lon: Number(this.#lon.value), lat: Number(this.#lat.value) };
      context.store.set({ place });
      context.bringIntoSight(place);
    });
    body.append(form, this.#content);
    context.store.on(["place", "product"], () => void this.refresh());
    context.store.on(["timeMs"], () => this.#drawNow());
    this.#hint();
  }

  async refresh(): Promise<void> {
    const { place, product } = this.#context.store.state;
    this.#asked?.abort();
    this.#clear();
    if (!place || product === null) {
      this.#hint();
      return;
    }
    const asked = new AbortController();
    this.#asked = asked;
    this.#lat.value = fieldText(place.lat);
    this.#lon.value = fieldText(place.lon);
    const bounds = this.#context.bounds();
    if (bounds && !contains(bounds, place)) {
      this.#content.replaceChildren(
        this.#title(place),
        el("p", { class: "no-data", id: "no-data" }, "There is no data here: the product does not reach this place."),
      );
      return;
    }
    this.#content.replaceChildren(this.#title(place), el("p", { class: "muted busy-line" }, "Reading the series …"));
    try {
      const answer = await api.point(product, place.lon, place.lat, asked.signal);
      if (!asked.signal.aborted) this.#draw(place, answer);
    } catch (error) {
      if (asked.signal.aborted) return;
      const reason = error instanceof Error ? error.message : String(error);
      this.#content.replaceChildren(this.#title(place), el("p", { class: "problem" }, reason));
      if (error instanceof ApiError && error.kind === "unreachable") this.#context.onError("point", error);
    }
  }

  #hint(): void {
    this.#content.replaceChildren(
      el("p", { class: "muted" }, "Click in the sea, or type a latitude and a longitude, to see the series there."),
    );
  }

  #title(place: Place): HTMLElement {
    return el("h2", { class: "place-title" }, `${latText(place.lat)}, ${lonText(place.lon)}`);
  }

  #draw(place: Place, answer: PointSeries): void {
    const holds = holdsAt(answer.quantity);
    const isBlended = isLinear(answer.quantity);
    const samples = isBlended ? samplesOf(answer.series, holds) : heldSamplesOf(answer.series);
    const unit = unitText(answer.unit);
    const cell = el(
      "p",
      { class: "muted" },
      `Grid cell centred on ${latText(answer.cell.lat_deg)}, ${lonText(answer.cell.lon_deg)} (row ${answer.cell.row}, column ${answer.cell.col})`,
    );
    if (!hasData(samples)) {
      this.#content.replaceChildren(
        this.#title(place),
        el("p", { class: "no-data", id: "no-data" }, "There is no data here: land, ice, or never observed."),
        cell,
        manifestLine(answer.manifest),
      );
      return;
    }
    const value = el("strong", { id: "place-value" });
    const when = el("span", { class: "muted" });
    const missing = el("p", { class: "problem", id: "place-missing", hidden: true });
    const plot = el("div", {
      class: "plot",
      id: "series-plot",
      role: "img",
      "data-points": String(answer.series.length),
      "aria-label": `Series of ${answer.series.length} values in ${unit}`,
    });
    const gaps = answer.series.filter((row) => row.value === null).length;
    const between = holds === "mid" ? "middles" : "ends, from zero at the first start";
    this.#content.replaceChildren(
      this.#title(place),
      el("p", { class: "muted" }, chemistry(this.#context.label())),
      el("p", { class: "reading" }, value, el("span", { class: "unit" }, unit), when),
      missing,
      plot,
      el(
        "p",
        { class: "muted" },
        `${answer.series.length} periods${gaps > 0 ? `, ${gaps} without data` : ""}; linear in time between their ${between}.`,
      ),
      cell,
      manifestLine(answer.manifest),
      el(
        "div",
        { class: "row actions" },
        el(
          "button",
          { type: "button", onclick: () => saveText(`${answer.product}-series.csv`, "text/csv", seriesCsv(answer)) },
          icon(DOWNLOAD),
          "CSV",
        ),
        el(
          "a",
          {
            class: "button",
            href: api.pointUrl(answer.product, place.lon, place.lat),
            target: "_blank",
            rel: "noopener",
          },
          "JSON",
        ),
      ),
    );
    const range = rangeOf(parseSteps(answer.series)) ?? { startMs: 0, endMs: 1 };
    const chart = seriesChart(plot, samples, range, unit, (timeMs) => {
      const steps = this.#context.steps();
      this.#context.store.set({ timeMs: quantise(steps, clampToRange(steps, timeMs)) });
    });
    this.#shown = { samples, isBlended, unit, chart, value, when, missing };
    this.#drawNow();
  }

  #drawNow(): void {
    const shown = this.#shown;
    const { timeMs } = this.#context.store.state;
    if (!shown || !Number.isFinite(timeMs)) return;
    const value = (shown.isBlended ? valueAt : heldAt)(shown.samples, timeMs);
    shown.value.textContent = value === null ? "no data" : valueText(value, 3);
    shown.when.textContent = formatInstant(timeMs);
    shown.missing.textContent = missingText(shown.samples, timeMs);
    shown.missing.hidden = shown.missing.textContent === "";
    shown.chart?.setNow(timeMs);
  }

  #clear(): void {
    this.#shown?.chart?.destroy();
    this.#shown = undefined;
  }
}

/** Adding zero turns a rounded -0 into 0. */
function fieldText(degrees: number): string {
  return (Number(degrees.toFixed(2)) + 0).toFixed(2);
}
