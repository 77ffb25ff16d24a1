//! "Render this view": the server's own image of what the camera looks down on, in a dialog, to look at or keep.
import { getPicture } from "../api/client";
import { globeUrl, MOST_SIDE_PX, within } from "../api/pictures";
import type { Mode } from "../api/types";
import { MODES } from "../api/words";
import type { LayerSpec } from "../globe/layer";
import { byId, el, icon } from "../page/dom";
import { latText, lonText } from "../page/format";
import { CLOSE, DOWNLOAD } from "../page/icons";
import type { CameraView } from "../state/camera";
import type { Store } from "../state/store";
import { viewOf } from "../stream/view";
import { formatInstant } from "../time/steps";

/** The longer side. The first is enough for a slide, and a few seconds' work where the server has no graphics chip. */
const LONG_SIDES_PX = [1024, 1920, 2560, MOST_SIDE_PX];

export class ViewDialog {
  readonly #store: Store;
  readonly #offered: () => readonly Mode[];
  readonly #isSynthetic: () => boolean;
  readonly #specIn: (mode: Mode) => LayerSpec | undefined;
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
    specIn: (mode: Mode) => LayerSpec | undefined,
  ) {
    this.#store = store;
    this.#offered = offered;
    this.#isSynthetic = isSynthetic;
    this.#specIn = specIn;
    const close = el(
      "button",
      { type: "button", class: "quiet", "aria-label": "Close", onclick: () => this.#dialog.close() },
      icon(CLOSE),
    );
    this.#mode.addEventListener("change", () => void this.#render());
    this.#size.addEventListener("change", () => void this.#render());
    this.#dialog.addEventListener("close", () => this.#asked?.abort());
    this.#dialog.append(
      el("div", { class: "dialog-head" }, el("h2", { id: "view-title" }, "Rendered view"), this.#size, this.#mode, close),
      this.#frame,
      el("div", { class: "dialog-foot" }, this.#caption, this.#save),
    );
    byId("dialogs").append(this.#dialog);
  }

  open(): void {
    const offered = MODES.filter((mode) => this.#offered().includes(mode));
    this.#mode.replaceChildren(...offered.map((mode) => el("option", { value: mode }, mode)));
    // The image is there for the volume; another mode is a choice away.
    this.#mode.value = offered.includes("volume") ? "volume" : (offered[0] ?? "map");
    this.#offerSizes();
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
    this.#frame.replaceChildren(el("p", { class: "muted busy-line" }, "The server is drawing …"));
    const url = globeUrl(spec.product, mode, viewOf(spec, camera, imageSize(Number(this.#size.value))));
    try {
      const blob = await getPicture(url, asked.signal);
      if (asked.signal.aborted) return;
      this.#show(blob, `${spec.product}-${mode}-${spec.timeIso.replace(/:/g, "")}.png`);
    } catch (error) {
      if (!asked.signal.aborted)
        this.#frame.replaceChildren(
          el("p", { class: "problem" }, error instanceof Error ? error.message : String(error)),
        );
    }
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
