//! The card of tabs: place, budget, check and look, one open at a time, closable so that the globe has the room.
import { el, icon } from "../page/dom";
import { BARS, CLOSE, PIN, SLIDERS, TICK, WAVE } from "../page/icons";
import type { Store, Tab } from "../state/store";

const TITLES: Record<Tab, [title: string, icon: string]> = {
  place: ["Place", PIN],
  budget: ["Budget", BARS],
  check: ["Check", TICK],
  look: ["Look", SLIDERS],
  platform: ["Observed", WAVE],
};

export class Panels {
  readonly bodies: Record<Tab, HTMLElement>;
  readonly #store: Store;
  readonly #container: HTMLElement;
  readonly #tabs = new Map<Tab, HTMLButtonElement>();
  readonly #close: HTMLButtonElement;

  constructor(container: HTMLElement, store: Store) {
    this.#container = container;
    this.#store = store;
    const list = el("div", { class: "tabs", role: "tablist", "aria-label": "Analysis and look" });
    this.bodies = {
      place: this.#body("place"),
      budget: this.#body("budget"),
      check: this.#body("check"),
      look: this.#body("look"),
      platform: this.#body("platform"),
    };
    for (const tab of Object.keys(TITLES) as Tab[]) {
      const [title, path] = TITLES[tab];
      const button = el(
        "button",
        { type: "button", role: "tab", class: "tab", id: `tab-${tab}`, "aria-controls": `panel-${tab}` },
        icon(path),
        title,
      );
      button.addEventListener("click", () => store.set({ tab: store.state.tab === tab ? null : tab }));
      button.addEventListener("keydown", (event) => this.#turn(event, tab));
      this.#tabs.set(tab, button);
      list.append(button);
    }
    this.#close = el(
      "button",
      { type: "button", class: "quiet", "aria-label": "Close the panel", onclick: () => store.set({ tab: null }) },
      icon(CLOSE),
    );
    container.append(el("div", { class: "tab-row" }, list, this.#close), ...Object.values(this.bodies));
    store.on(["tab"], () => this.#draw());
    this.#draw();
  }

  /** A tab without anything to show is not offered. */
  offer(tab: Tab, isOffered: boolean): void {
    const button = this.#tabs.get(tab);
    if (button) button.hidden = !isOffered;
    if (!isOffered && this.#store.state.tab === tab) this.#store.set({ tab: null });
  }

  #body(tab: Tab): HTMLElement {
    return el("div", {
      class: "panel-body",
      role: "tabpanel",
      id: `panel-${tab}`,
      "aria-labelledby": `tab-${tab}`,
      tabindex: "0",
      hidden: true,
    });
  }

  #turn(event: KeyboardEvent, from: Tab): void {
    const by = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    if (by === 0) return;
    const offered = [...this.#tabs].filter(([, button]) => !button.hidden);
    const at = offered.findIndex(([tab]) => tab === from);
    const [tab, button] = offered[(at + by + offered.length) % offered.length] ?? [from, undefined];
    this.#store.set({ tab });
    button?.focus();
  }

  #draw(): void {
    const open = this.#store.state.tab;
    for (const [tab, button] of this.#tabs) {
      button.setAttribute("aria-selected", String(tab === open));
      button.tabIndex = tab === (open ?? "place") ? 0 : -1;
      this.bodies[tab].hidden = tab !== open;
    }
    this.#close.hidden = open === null;
    this.#container.classList.toggle("open", open !== null);
  }
}
