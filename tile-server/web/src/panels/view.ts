//! "Render this view": the server's own image of what the camera looks down on, in a dialog, to look at or keep.
import { getPicture } from "../api/client";
import { globeUrl, MOST_SIDE_PX, within } from "../api/pictures";
import type { Mode } from "../api/types";
import { MODES } from "../api/words";
import type { LayerSpec } from "../globe/layer";
import { byId, el, icon } from "../page/dom";
import { latText, lonText } from "../page/format";
import { CLOSE, DOWNLOAD } from "../page/icons";
import type { Coverage } from "../film/plan";
import { FilmForm, type FilmView } from "./film-form";
import type { CameraView } from "../state/camera";
import type { Store } from "../state/store";
import { viewOf } from "../stream/view";
import { formatInstant, toIso } from "../time/steps";

type SpecIn = (mode: Mode) => LayerSpec | undefined;

/** The longer side. The first is enough for a slide, and a few seconds' work where the server has no graphics chip. */
const LONG_SIDES_PX = [1024, 1920, 2560, 3840, MOST_SIDE_PX];

export class ViewDialog {
  readonly #store: Store;
  readonly #offered: () => readonly Mode[];
  readonly #isSynthetic: () => boolean;
  readonly #specIn: SpecIn;
  readonly #coverage: () => Coverage | undefined;
  readonly #film = new FilmForm(() => this.#filmView());
  readonly #cancel = el("button", { type: "button", id: "view-cancel" }, "Cancel");
  readonly #dialog = el("dialog", { class: "view-dialog", "aria-labelledby": "view-title" });
  readonly #mode = el("select", { id: "view-mode", "aria-label": "Mode of the image" });
  readonly #size = el("select", { id: "view-size", "aria-label": "Size of the image" });
  readonly #frame = el("div", { class: "view-frame" });
  readonly #caption = el("p", { class: "muted" });
  readonly #save = el("a", { class: "button", hidden: true }, icon(DOWNLOAD), "Save the image");
  #imageUrl: string | undefined;
  #asked: AbortController | undefined;

  constructor(
    store: Store,
    offered: () => readonly Mode[],
    isSynthetic: () => boolean,
    specIn: SpecIn,
    coverage: () => Coverage | undefined,
  ) {
    this.#store = store;
    this.#offered = offered;
    this.#isSynthetic = isSynthetic;
    this.#specIn = specIn;
    this.#coverage = coverage;
    this.#cancel.addEventListener("click", () => this.#asked?.abort());
    const close = el(
      "button",
      { type: "button", class: "quiet", "aria-label": "Close", onclick: () => this.#dialog.close() },
      icon(CLOSE),
    );
    this.#mode.addEventListener("change", () => void this.#render());
    this.#size.addEventListener("change", () => void this.#render());
    this.#dialog.addEventListener("close", () => {
      this.#asked?.abort();
      this.#film.stop();
    });
    this.#dialog.append(
      el("div", { class: "dialog-head" }, el("h2", { id: "view-title" }, "Rendered view"), this.#size, this.#mode, close),
      this.#frame,
      el("div", { class: "dialog-foot" }, this.#caption, this.#save),
      this.#film.element,
    );
    byId("dialogs").append(this.#dialog);
  }

  open(): void {
    const offered = MODES.filter((mode) => this.#offered().includes(mode));
    this.#mode.replaceChildren(...offered.map((mode) => el("option", { value: mode }, mode)));
    // The image is there for the volume; another mode is a choice away.
    this.#mode.value = offered.includes("volume") ? "volume" : (offered[0] ?? "map");
    this.#offerSizes();
    this.#film.offer(this.#coverage());
    this.#dialog.showModal();
    void this.#render();
  }

  async #render(): Promise<void> {
    const { camera } = this.#store.state;
    const mode = this.#mode.value as Mode;
    const spec = this.#specIn(mode);
    if (!spec) return;
    this.#asked?.abort();
    const asked = new AbortController();
    this.#asked = asked;
    this.#save.hidden = true;
    this.#caption.textContent = captionOf(spec.timeIso, camera, this.#isSynthetic());
    const bar = el("progress", { id: "view-progress", "aria-label": "Progress of the image" });
    const says = el("p", { class: "muted busy-line" }, "The server is drawing …");
    this.#frame.replaceChildren(el("div", { class: "view-busy" }, says, bar, this.#cancel));
    const startedMs = performance.now();
    // How far a picture is drawn nobody knows before it is there; that it is being drawn one sees.
    const clock = setInterval(() => {
      says.textContent = `The server is drawing … ${Math.round((performance.now() - startedMs) / 1000)} s`;
    }, 1000);
    const url = globeUrl(spec.product, mode, viewOf(spec, camera, imageSize(Number(this.#size.value))));
    try {
      const blob = await getPicture(url, asked.signal, (share) => {
        clearInterval(clock);
        says.textContent = `The picture is coming … ${Math.round(100 * share)} %`;
        bar.value = share;
      });
      if (asked.signal.aborted) return;
      this.#show(blob, `${spec.product}-${mode}-${spec.timeIso.replace(/:/g, "")}.png`);
    } catch (error) {
      if (this.#asked !== asked) return;
      const text = asked.signal.aborted ? "Cancelled." : error instanceof Error ? error.message : String(error);
      this.#frame.replaceChildren(el("p", { class: asked.signal.aborted ? "muted" : "problem" }, text));
    } finally {
      clearInterval(clock);
    }
  }

  /** What the dialog shows, at any instant: all of one version, whatever comes while frames are drawn. */
  #filmView(): FilmView | undefined {
    const { camera } = this.#store.state;
    const mode = this.#mode.value as Mode;
    const spec = this.#specIn(mode);
    const coverage = this.#coverage();
    if (!spec || !coverage) return undefined;
    // Encoders halve the colours' resolution.
    const size = imageSize(Number(this.#size.value));
    const even = { width: size.width & ~1, height: size.height & ~1 };
    const addressAt = (timeMs: number) => globeUrl(spec.product, mode, viewOf(specAt(spec, coverage, timeMs), camera, even));
    return { ...even, coverage, name: `${spec.product}-${mode}`, addressAt };
  }

  /** The size that was chosen stays, in the shape that the window has now. */
  #offerSizes(): void {
    const chosen = this.#size.value || String(LONG_SIDES_PX[0]);
    const options = LONG_SIDES_PX.map((longest) => {
      const { width, height } = imageSize(longest);
      return el("option", { value: String(longest) }, `${width} × ${height}`);
    });
    this.#size.replaceChildren(...options);
    this.#size.value = chosen;
  }

  #show(blob: Blob, name: string): void {
    if (this.#imageUrl) URL.revokeObjectURL(this.#imageUrl);
    this.#imageUrl = URL.createObjectURL(blob);
    this.#frame.replaceChildren(
      el("img", { src: this.#imageUrl, id: "view-image", alt: "The ocean as the server renders it from here" }),
    );
    this.#save.href = this.#imageUrl;
    this.#save.download = name;
    this.#save.hidden = false;
  }
}

/** The same picture at another instant; of the first and the last day of what there is there may be less than the whole. */
export function specAt(spec: LayerSpec, { startMs, endMs }: Coverage, timeMs: number): LayerSpec {
  return { ...spec, timeIso: toIso(Math.min(Math.max(timeMs, startMs), endMs)) };
}

/** The globe's shape in the window, so that the image shows what the globe shows. */
function imageSize(longest: number): { width: number; height: number } {
  const { clientWidth, clientHeight } = byId("globe");
  const enlarged = longest / Math.max(1, clientWidth, clientHeight);
  return within(longest, clientWidth * enlarged, clientHeight * enlarged);
}

function captionOf(timeIso: string, camera: CameraView, isSynthetic: boolean): string {
  const { lat, lon, heightKm, headingDeg, pitchDeg } = camera;
  const tiltDeg = Math.round(90 + pitchDeg);
  const way = tiltDeg === 0 ? "" : `, tilted ${tiltDeg}° towards ${Math.round((headingDeg + 360) % 360)}°`;
  const at = `${formatInstant(Date.parse(timeIso))}, over ${latText(lat, 1)}, ${lonText(lon, 1)}, ${Math.round(heightKm)} km up`;
  return at + way + (isSynthetic ? " – synthetic data" : "");
}
