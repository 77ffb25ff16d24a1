//! Observations switched on and off: the toggle in the state in, platforms on the globe and the chosen one's panel out.
import * as observations from "../api/observations";
import type { Platform } from "../api/types";
import type { Drawn } from "../globe/drawn";
import type { Globe } from "../globe/globe";
import { PlatformLayer } from "../globe/platforms";
import { el } from "../page/dom";
import type { Store } from "../state/store";
import type { Panels } from "./panels";
import { PlatformPanel } from "./platform";

export class ObservationLayer {
  readonly #store: Store;
  readonly #panels: Panels;
  readonly #panel: PlatformPanel;
  readonly #layer: PlatformLayer;
  readonly #status: HTMLElement;
  readonly #onError: (key: string, error: unknown) => void;
  #asked: AbortController | undefined;
  #platforms: readonly Platform[] = [];

  constructor(
    container: HTMLElement,
    globe: Globe,
    store: Store,
    panels: Panels,
    onError: (key: string, error: unknown) => void,
  ) {
    this.#store = store;
    this.#panels = panels;
    this.#onError = onError;
    this.#layer = new PlatformLayer(globe.scene);
    this.#panel = new PlatformPanel(panels.bodies.platform, onError);
    this.#status = el("span", { class: "muted", id: "observations-status", role: "status" });
    const toggle = el("input", { type: "checkbox", id: "observations", checked: store.state.observations });
    toggle.addEventListener("change", () => store.set({ observations: toggle.checked }));
    container.append(
      el("label", { class: "field row observations" }, toggle, el("span", {}, "Observations"), this.#status),
    );
    store.on(["observations"], (state) => {
      toggle.checked = state.observations;
      void this.#switch(state.observations);
    });
    panels.offer("platform", false);
    if (store.state.observations) void this.#switch(true);
  }

  get platforms(): readonly Platform[] {
    return this.#platforms;
  }

  get drawn(): Drawn {
    return this.#layer.drawn;
  }

  /** Chooses the platform at a canvas point, if there is one. */
  choose(position: { x: number; y: number }): boolean {
    const platform = this.#platforms.length > 0 ? this.#layer.at(position) : undefined;
    if (!platform) return false;
    this.#layer.show(this.#platforms, platform);
    this.#panels.offer("platform", true);
    this.#store.set({ tab: "platform" });
    void this.#panel.show(platform);
    return true;
  }

  async #switch(isOn: boolean): Promise<void> {
    this.#asked?.abort();
    this.#platforms = [];
    this.#layer.show([], null);
    this.#status.textContent = "";
    if (!isOn) {
      this.#panels.offer("platform", false);
      void this.#panel.show(null);
      return;
    }
    const asked = new AbortController();
    this.#asked = asked;
    this.#status.textContent = "asking …";
    try {
      const found = await observations.platforms(asked.signal);
      if (asked.signal.aborted) return;
      this.#platforms = found.features;
      this.#layer.show(found.features, null);
      const count = observations.countText(found.features);
      this.#status.textContent = found.is_complete ? count : `the first ones: ${count}`;
    } catch (error) {
      if (asked.signal.aborted) return;
      this.#onError("observations", error);
      this.#store.set({ observations: false });
    }
  }
}
