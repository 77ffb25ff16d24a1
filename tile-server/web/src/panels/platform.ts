//! The observations panel: a platform in, what it measured as a plot with units and quality out.
import * as observations from "../api/observations";
import type { ObservationPage, Platform } from "../api/types";
import { el } from "../page/dom";
import { chemistry, latText, lonText, unitText } from "../page/format";
import type { Chart } from "./chart";
import { type Group, groupsOf, qualityText } from "./measured";
import { measuredChart } from "./measured-chart";

export class PlatformPanel {
  readonly #body: HTMLElement;
  readonly #onError: (key: string, error: unknown) => void;
  #asked: AbortController | undefined;
  #chart: Chart | undefined;

  constructor(body: HTMLElement, onError: (key: string, error: unknown) => void) {
    this.#body = body;
    this.#onError = onError;
  }

  async show(platform: Platform | null): Promise<void> {
    this.#asked?.abort();
    this.#clear();
    if (!platform) return;
    const asked = new AbortController();
    this.#asked = asked;
    this.#body.replaceChildren(...head(platform), el("p", { class: "muted busy-line" }, "Reading what it measured …"));
    const { dataset, platform: name } = platform.properties;
    try {
      const answer = await observations.series(dataset, name, asked.signal);
      if (!asked.signal.aborted) this.#draw(platform, answer);
    } catch (error) {
      if (asked.signal.aborted) return;
      const reason = error instanceof Error ? error.message : String(error);
      this.#body.replaceChildren(...head(platform), el("p", { class: "problem" }, reason));
      this.#onError("observations", error);
    }
  }

  #draw(platform: Platform, answer: ObservationPage): void {
    const groups = groupsOf(platform.properties.kind, answer.observations);
    const [first] = groups;
    if (!first) {
      this.#body.replaceChildren(...head(platform), el("p", { class: "no-data" }, "It measured nothing in this period."));
      return;
    }
    const choice = el(
      "select",
      { id: "platform-property", "aria-label": "What was measured" },
      ...groups.map((group, index) => el("option", { value: String(index) }, group.title)),
    );
    const shown = el("div", { class: "place-content" });
    choice.addEventListener("change", () => this.#plot(shown, groups[Number(choice.value)] ?? first));
    const more =
      answer.next === null
        ? null
        : el("p", { class: "muted" }, `The first ${answer.observations.length} values; the server has more.`);
    const { dataset, platform: name } = platform.properties;
    const json = el(
      "a",
      { class: "button", href: observations.seriesUrl(dataset, name), target: "_blank", rel: "noopener" },
      "JSON",
    );
    this.#body.replaceChildren(...head(platform), choice, shown);
    if (more) this.#body.append(more);
    this.#body.append(el("div", { class: "row actions" }, json));
    this.#plot(shown, first);
  }

  #plot(into: HTMLElement, group: Group): void {
    this.#chart?.destroy();
    const unit = unitText(group.unit);
    const plot = el("div", {
      class: "plot",
      id: "platform-plot",
      role: "img",
      "data-points": String(group.points.length),
      "data-unit": group.unit,
      "aria-label": `${group.points.length} values of ${group.title} in ${unit}, over ${group.over}`,
    });
    into.replaceChildren(
      plot,
      el(
        "p",
        { class: "muted", id: "platform-quality" },
        `${group.points.length} values in ${unit}. Quality: ${qualityText(group.points)}.`,
      ),
    );
    this.#chart = measuredChart(plot, group, unit);
  }

  #clear(): void {
    this.#chart?.destroy();
    this.#chart = undefined;
    this.#body.replaceChildren();
  }
}

function head(platform: Platform): HTMLElement[] {
  const { platform: name, kind, dataset, lon_deg, lat_deg, first, last, count } = platform.properties;
  const days = first.slice(0, 10) === last.slice(0, 10) ? first.slice(0, 10) : `${first.slice(0, 10)} to ${last.slice(0, 10)}`;
  return [
    el("h2", { class: "place-title", id: "platform-name" }, name),
    el("p", { class: "muted" }, `${kind[0]?.toUpperCase()}${kind.slice(1)} of ${chemistry(dataset)}`),
    el("p", { class: "muted" }, `${latText(lat_deg)}, ${lonText(lon_deg)}; ${days}; ${count} observations`),
  ];
}
