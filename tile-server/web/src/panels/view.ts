//! "Render this view": the server's own image of what the camera looks down on, in a dialog, to look at or keep.
import { getPicture } from "../api/client";
import { globeUrl } from "../api/pictures";
import type { Mode } from "../api/types";
import { MODES } from "../api/words";
import { viewParameters } from "../look/address";
import type { Look } from "../look/look";
import { byId, el, icon } from "../page/dom";
import { latText, lonText } from "../page/format";
import { CLOSE, DOWNLOAD } from "../page/icons";
import type { Store } from "../state/store";
import { formatInstant, toIso } from "../time/steps";

/** The longer side: enough for a slide, and a few seconds' work where the server has no graphics chip. */
const LONG_SIDE_PX = 1024;

export class ViewDialog {
  readonly #store: Store;
  readonly #offered: () => readonly Mode[];
  readonly #isSynthetic: () => boolean;
  readonly #lookIn: (mode: Mode) => Look;
  readonly #dialog = el("dialog", { class: "view-dialog", "aria-labelledby": "view-title" });
  readonly #mode = el("select", { id: "view-mode", "aria-label": "Mode of the image" });
  readonly #frame = el("div", { class: "view-frame" });
  readonly #caption = el("p", { class: "muted" });
  readonly #save = el("a", { class: "button", hidden: true }, icon(DOWNLOAD), "Save the image");
  #imageUrl: string | undefined;
  #asked: AbortController | undefined;

  constructor(
    store: Store,
    offered: () => readonly Mode[],
    isSynthetic: () => boolean,
    lookIn: (mode: Mode) => Look,
  ) {
    this.#store = store;
    this.#offered = offered;
    this.#isSynthetic = isSynthetic;
    this.#lookIn = lookIn;
    const close = el(
      "button",
      { type: "button", class: "quiet", "aria-label": "Close", onclick: () => this.#dialog.close() },
      icon(CLOSE),
    );
    this.#mode.addEventListener("change", () => void this.#render());
    this.#dialog.addEventListener("close", () => this.#asked?.abort());
    this.#dialog.append(
      el("div", { class: "dialog-head" }, el("h2", { id: "view-title" }, "Rendered view"), this.#mode, close),
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
    this.#dialog.showModal();
    void this.#render();
  }

  async #render(): Promise<void> {
    const { product, timeMs, camera } = this.#store.state;
    if (product === null) return;
    this.#asked?.abort();
    const asked = new AbortController();
    this.#asked = asked;
    this.#save.hidden = true;
    this.#caption.textContent = `${formatInstant(timeMs)}, over ${latText(camera.lat, 1)}, ${lonText(camera.lon, 1)}, ${Math.round(camera.heightKm)} km up${this.#isSynthetic() ? " – synthetic data" : ""}`;
    this.#frame.replaceChildren(el("p", { class: "muted busy-line" }, "The server is drawing …"));
    const mode = this.#mode.value as Mode;
    const url = globeUrl(product, mode, {
      lon: camera.lon,
      lat: camera.lat,
      heightKm: camera.heightKm,
      headingDeg: camera.headingDeg,
      pitchDeg: camera.pitchDeg,
      timeIso: toIso(timeMs),
      look: viewParameters(this.#lookIn(mode)),
      ...imageSize(),
    });
    try {
      const blob = await getPicture(url, asked.signal);
      if (asked.signal.aborted) return;
      this.#show(blob, `${product}-${mode}-${toIso(timeMs).replace(/:/g, "")}.png`);
    } catch (error) {
      if (!asked.signal.aborted)
        this.#frame.replaceChildren(
          el("p", { class: "problem" }, error instanceof Error ? error.message : String(error)),
        );
    }
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

/** The window's shape, so that the image shows about what the globe shows. */
function imageSize(): { width: number; height: number } {
  const aspect = window.innerWidth / Math.max(1, window.innerHeight);
  const [width, height] = aspect >= 1 ? [LONG_SIDE_PX, LONG_SIDE_PX / aspect] : [LONG_SIDE_PX * aspect, LONG_SIDE_PX];
  return { width: Math.round(width), height: Math.round(height) };
}
