//! What the page shows: what the server has and what the reader chose in; the layer, its legend and the cards of it out.
import * as api from "./api/requests";
import type { News, Product } from "./api/types";
import { touches } from "./api/updates";
import { contains, isWhole } from "./globe/box";
import type { Globe } from "./globe/globe";
import type { Marks } from "./globe/marks";
import type { Presenter } from "./globe/presenter";
import type { TileSources } from "./globe/sources";
import type { LayerStage } from "./globe/stage";
import type { LegendCard } from "./look/legend-card";
import { withoutColours } from "./look/look";
import type { LookPanel } from "./look/panel";
import { byId } from "./page/dom";
import { titleText } from "./page/format";
import type { Notices } from "./page/notices";
import { COAST } from "./state/camera";
import type { Live } from "./stream/live";
import type { BudgetPanel } from "./panels/budget";
import { drawCheck } from "./panels/check";
import type { Controls } from "./panels/controls";
import type { Panels } from "./panels/panels";
import type { PlacePanel } from "./panels/place";
import type { Catalogue } from "./state/catalogue";
import type { Inventory } from "./state/inventory";
import { INITIAL, type State, type Store } from "./state/store";
import { clampToRange, isOutside, outsideText } from "./time/steps";
import type { Timeline } from "./time/timeline";

/** The parts of the page that follow what is chosen. */
export interface Parts {
  store: Store;
  inventory: Inventory;
  notices: Notices;
  globe: Globe;
  sources: TileSources;
  stage: LayerStage;
  presenter: Presenter;
  live: Live;
  marks: Marks;
  controls: Controls;
  legend: LegendCard;
  timeline: Timeline;
  panels: Panels;
  placePanel: PlacePanel;
  budgetPanel: BudgetPanel;
  lookPanel: LookPanel;
  report: (key: string, error: unknown) => void;
  /** The catalogue is there and the first layer is drawn. */
  onReady: () => void;
}

export class Viewer {
  readonly #parts: Parts;
  /** The instant that an address asks for, until it was held against what there is. */
  #askedMs: number | undefined;
  /** The page was opened over a place of its reader's choice. */
  readonly #isPlaced: boolean;
  /** Nothing was said of how the page shall open. */
  #isFree: boolean;

  /** `asked` is what the page's address said when it was opened. */
  constructor(parts: Parts, asked: Partial<State>) {
    this.#parts = parts;
    this.#askedMs = asked.timeMs;
    this.#isPlaced = asked.camera !== undefined;
    this.#isFree = asked.camera === undefined && asked.mode === undefined;
    const { store, notices, stage, presenter, live, marks } = parts;
    store.on(["opacity"], (state) => {
      stage.opacity = state.opacity;
    });
    store.on(["place"], (state) => marks.place(state.place));
    store.on(["product"], () => {
      // One product's picture must not stay under another one's legend, not even while the other loads.
      presenter.reset();
      live.clear();
      this.#useProduct();
      this.#bringIntoSight();
    });
    store.on(["product", "mode", "timeMs", "look"], () => this.#showLayer());
    store.on(["look", "mode"], () => this.#readyLegend());
    // A new wish is a new chance: an old complaint about pictures would only confuse.
    store.on(["mode", "product", "timeMs", "look"], () => {
      for (const key of ["layer", "tiles", "legend"]) notices.clear(key);
    });
    store.on(["product", "timeMs"], () => notices.clear("outside"));
  }

  /** Loads what the page needs; again when a lost server is back, where a whole picture in sight is kept. */
  async begin(): Promise<void> {
    const { store, inventory, notices, controls, sources, presenter, live, report, onReady } = this.#parts;
    // Asked at the same time as the products, not after them.
    const offered = this.#isFree ? live.offered() : Promise.resolve(false);
    try {
      await inventory.load();
    } catch (error) {
      report("products", error);
      return;
    }
    // A server that is back may be another one.
    sources.forget();
    const { catalogue } = inventory;
    notices.clear("products");
    const first = catalogue.first;
    if (!first) {
      notices.show("products", "The server has no products yet. Ingest a file and load this page again.");
      return;
    }
    controls.setProducts(catalogue.products);
    const wanted = store.state.product;
    if (wanted !== null && !catalogue.find(wanted))
      notices.show("product", `The server has no product “${wanted}”; showing “${first.title}” instead.`);
    const chosen = catalogue.find(wanted) ?? first;
    const isFlight = (await offered) && chosen.modes.includes("volume") && isWhole(chosen.bounds_deg);
    if (this.#isFree && isFlight) this.#takeOff(chosen);
    this.#isFree = false;
    const look = inventory.drawable(store.state.look);
    if (store.state.product === chosen.product) {
      store.set({ look });
      this.#useProduct();
      this.#bringIntoSight();
    } else store.set({ product: chosen.product, look: wanted === null ? look : withoutColours(look) });
    live.opened();
    this.#showLayer();
    void Promise.all([presenter.idle(), live.settled()]).then(onReady);
    await this.#loadAside();
  }

  /**
   * Shows what is new in the page that is open: what did not change stays as it is. `isAnew`: news may have been missed, so
   * that the server's list is held against the one that is here.
   */
  async renew(told: News[], isAnew: boolean): Promise<void> {
    const { store, inventory, notices, controls, sources, placePanel, budgetPanel, lookPanel, report } = this.#parts;
    let known: Catalogue;
    try {
      known = await inventory.renew();
    } catch (error) {
      report("products", error);
      return;
    }
    const { catalogue } = inventory;
    const missed = isAnew ? catalogue.newsSince(known) : [];
    const all = [...told, ...missed.filter(({ product }) => told.every((news) => news.product !== product))];
    if (all.length === 0) return;
    const before = known.find(store.state.product);
    for (const news of all) {
      // Told again of a version that is known: what lifts its particles is there now.
      if (known.find(news.product)?.manifest === news.manifest) catalogue.revise(news.product);
    }
    const relief = store.state.look.relief;
    const isReliefNew = before !== undefined && all.some((news) => news.product === relief);
    if (isReliefNew) catalogue.revise(before.product);
    sources.forget();
    notices.tell("news", `New data: ${catalogue.titlesOf(all.map((news) => news.product)).join(", ")}`);
    controls.setProducts(catalogue.products);
    const now = inventory.product;
    if (!now) return;
    if (!before) {
      await this.begin();
      return;
    }
    controls.setProduct(now);
    lookPanel.draw();
    const shown = all.filter((news) => news.product === now.product);
    if (isReliefNew) this.#showLayer();
    if (shown.length === 0) return;
    if (JSON.stringify(before.steps) !== JSON.stringify(now.steps)) this.#useProduct();
    if (shown.some((news) => touches(news, store.state.timeMs))) this.#showLayer();
    await Promise.all([placePanel.refresh(), budgetPanel.renew()]);
  }

  /** Shows what a typed address says, and what it leaves out as a new page would. */
  goTo(change: Partial<State>): void {
    const { store, inventory, globe } = this.#parts;
    let look = inventory.drawable(change.look ?? INITIAL.look);
    if (change.product !== undefined && !inventory.catalogue.find(change.product)) {
      delete change.product;
      look = withoutColours(look);
    }
    if (change.camera) globe.view = change.camera;
    this.#askedMs = change.timeMs;
    const { region, opacity, observations, live } = INITIAL;
    store.set({ place: null, tab: null, region, opacity, observations, live, ...change, look });
    // A change of product has looked at the instant already.
    if (this.#askedMs !== undefined) this.#useProduct();
  }

  /** Where pictures follow the camera the page begins low over the sea, so that what stands above it is seen to stand. */
  #takeOff({ product }: Product): void {
    const { store, inventory, globe } = this.#parts;
    globe.start = COAST;
    globe.view = COAST;
    // The picture's own ground has no land colours by which one would know where one is.
    store.set({ mode: "volume", camera: COAST, look: { ...store.state.look, coastlines: true } });
    // What accumulates stands highest at the end.
    const last = inventory.catalogue.stepsOf(product).at(-1);
    if (last) this.#askedMs ??= last.atMs;
  }

  /** Regions and the check table: the globe does not wait for them. */
  async #loadAside(): Promise<void> {
    const { store, inventory, marks, panels, placePanel, budgetPanel, report } = this.#parts;
    // Nobody publishes budgets of made-up data.
    const isAllSynthetic = inventory.catalogue.products.every((each) => each.synthetic);
    const published = isAllSynthetic ? Promise.resolve(undefined) : api.check();
    await Promise.all([
      api
        .regions()
        .then((regions) => budgetPanel.setRegions(regions))
        .catch((error: unknown) => report("regions", error)),
      published
        .then((check) => {
          panels.offer("check", check !== undefined);
          if (check) drawCheck(panels.bodies.check, check);
        })
        .catch((error: unknown) => report("check", error)),
    ]);
    marks.place(store.state.place);
    await Promise.all([placePanel.refresh(), budgetPanel.refresh()]);
  }

  #useProduct(): void {
    const { store, inventory, notices, controls, timeline, budgetPanel, lookPanel } = this.#parts;
    const chosen = inventory.product;
    if (!chosen) return;
    controls.setProduct(chosen);
    byId("synthetic").hidden = !chosen.synthetic;
    document.body.classList.toggle("is-synthetic", chosen.synthetic);
    document.title = `${titleText(chosen)} – Fluxglobe`;
    const known = inventory.steps;
    timeline.setSteps(known);
    budgetPanel.setSteps(chosen.product, known);
    lookPanel.draw();
    if (known.length === 0) notices.show("steps", `“${chosen.title}” has no periods yet.`);
    else notices.clear("steps");
    const mode = chosen.modes.includes(store.state.mode) ? store.state.mode : (chosen.modes[0] ?? "map");
    const wantedMs = this.#askedMs ?? Number.NaN;
    this.#askedMs = undefined;
    const isAsked = Number.isFinite(wantedMs);
    // Another product's years say nothing here: unless its address names an instant, it begins with its own first picture.
    const timeMs = isAsked
      ? clampToRange(known, wantedMs)
      : isOutside(known, store.state.timeMs) || !Number.isFinite(store.state.timeMs)
        ? (known[0]?.atMs ?? Number.NaN)
        : store.state.timeMs;
    store.set({ mode, timeMs });
    this.#readyLegend();
    if (isAsked && isOutside(known, wantedMs)) notices.show("outside", outsideText(titleText(chosen), known, wantedMs));
  }

  /** Only for a product that was chosen: new data of the one in sight must not turn the globe. */
  #bringIntoSight(): void {
    const { store, inventory, globe } = this.#parts;
    const bounds = inventory.product?.bounds_deg;
    if (bounds && !contains(bounds, store.state.camera) && !this.#isPlaced) globe.lookAt(bounds);
  }

  #showLayer(): void {
    const { store, inventory, presenter } = this.#parts;
    const spec = inventory.layerAt(store.state.timeMs);
    if (spec) presenter.want(spec);
  }

  /** A picture that is still to come brings its legend with it; until there is any, the legend is that of what is waited for. */
  #readyLegend(): void {
    const { store, inventory, stage, live, legend } = this.#parts;
    const { mode } = store.state;
    if (!inventory.product) return;
    const { product, manifest } = inventory.product;
    const layer = { product, manifest, mode, look: inventory.lookIn(mode) };
    if (stage.shownKey === undefined && !live.isShown) void legend.show(layer);
    else legend.learn(layer);
  }
}
