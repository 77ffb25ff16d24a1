//! The page's wiring: reads the address, asks for the catalogue, and joins store, globe, layers and cards.
import "cesium/Build/Cesium/Widgets/CesiumWidget/CesiumWidget.css";
import "./style/base.css";
import "./style/fields.css";
import "./style/layer.css";
import "./style/analysis.css";
import "./style/look.css";
import "./style/time.css";
import "./style/messages.css";
import "./style/phone.css";
import * as api from "./api/api";
import { BudgetPanel } from "./panels/budget";
import { contains } from "./globe/box";
import { CameraButtons } from "./globe/camera-buttons";
import { Catalogue, FLUX } from "./state/catalogue";
import { drawCheck } from "./panels/check";
import { Connection } from "./page/connection";
import { Controls } from "./panels/controls";
import { byId } from "./page/dom";
import { titleText } from "./page/format";
import { Globe } from "./globe/globe";
import { decodeHash, encodeHash } from "./state/hash";
import { LayerStage } from "./globe/stage";
import { LegendCard } from "./look/legend-card";
import { possible, withoutColours, type Look } from "./look/look";
import { offerOf } from "./look/offer";
import { LookPanel } from "./look/panel";
import { Marks } from "./globe/marks";
import { Notices } from "./page/notices";
import { ObservationLayer } from "./panels/observation-layer";
import { Panels } from "./panels/panels";
import { PlacePanel } from "./panels/place";
import { Playback } from "./time/playback";
import { Pointer } from "./globe/pointer";
import { Presenter } from "./globe/presenter";
import { installProbe } from "./probe";
import { chooseQuality } from "./globe/quality";
import { INITIAL, Store } from "./state/store";
import { TileCounts } from "./globe/tiles";
import { Timeline } from "./time/timeline";
import { clampToRange, isOutside, outsideText } from "./time/steps";
import { touches, Updates, type News } from "./api/updates";
import { ViewDialog } from "./panels/view";

/** Browsers refuse a page that rewrites its address too often. */
const ADDRESS_PAUSE_MS = 300;

const asked = decodeHash(location.hash);
/** The instant that an address asks for, until it was held against what there is. */
let askedMs = asked.timeMs;
const store = new Store({ ...INITIAL, ...asked });
const notices = new Notices();
let catalogue = new Catalogue([]);
let palettes: readonly api.Palette[] = [];

const globe = makeGlobe();
const counts = new TileCounts();
const connection = new Connection(
  notices,
  () => store.set({ playing: false }),
  () => {
    // What loads may be waiting for tiles that already failed while the server was away.
    presenter.abandon();
    void begin();
  },
);
const stage = new LayerStage(
  globe.scene,
  counts,
  store.state.opacity,
  (status, url) => void connection.tileFailed(status, url),
);
const presenter = new Presenter(stage);
const marks = new Marks(globe.scene);
const pointer = new Pointer(
  globe,
  (place) => store.set({ place, tab: "place" }),
  (position) => measured.choose(position),
);
const steps = () => catalogue.stepsOf(store.state.product);
const product = () => catalogue.find(store.state.product);
const report = (key: string, error: unknown) => connection.report(key, error);

const view = new ViewDialog(
  store,
  () => product()?.modes ?? [],
  () => product()?.synthetic ?? false,
  (mode) => catalogue.lookIn(mode, store.state),
);
const controls = new Controls(byId("controls"), store, () => view.open());
const legend = new LegendCard(controls.legend, (id, mode) => catalogue.usualLegend(id, mode), report);
const timeline = new Timeline(byId("timeline"), store);
const panels = new Panels(byId("panels"), store);
const measured = new ObservationLayer(controls.observations, globe, store, panels, report);
const placePanel = new PlacePanel(panels.bodies.place, {
  store,
  steps,
  label: () => product()?.legend.label ?? "",
  bounds: () => product()?.bounds,
  onError: report,
});
const budgetPanel = new BudgetPanel(panels.bodies.budget, {
  store,
  isFlux: () => product()?.quantity === FLUX,
  drawBox: (onChange, onEnd) => pointer.drawBox(onChange, onEnd),
  markRegion: (box) => marks.region(box),
  onError: report,
});
const lookPanel = new LookPanel(panels.bodies.look, store, () => offerOf(catalogue, palettes, store.state));
new CameraButtons(byId("camera"), globe);
new Playback(store, presenter, steps, (timeMs) => catalogue.layerAt(store.state, timeMs));
const probe = installProbe(store, counts, globe, () => stage.shownKey, () => measured.platforms);

controls.watch(counts);
stage.onReveal = (spec) => void legend.show(spec);
globe
  .addBaseImagery()
  .catch(() => notices.show("base", "The base map is missing from this server; data is drawn on plain water."));
globe.view = store.state.camera;
globe.scene.camera.percentageChanged = 0.01;
globe.scene.camera.changed.addEventListener(() => store.set({ camera: globe.view }));
globe.scene.camera.moveEnd.addEventListener(() => store.set({ camera: globe.view }));

store.on(["opacity"], (state) => {
  stage.opacity = state.opacity;
});
store.on(["place"], (state) => marks.place(state.place));
store.on(["product"], () => {
  // One product's picture must not stay under another one's legend, not even while the other loads.
  presenter.reset();
  useProduct();
  bringIntoSight();
});
store.on(["mode", "product"], (state) => {
  if (state.product === null) return;
  catalogue.learn(state.product, state.mode).then(showLayer, (error: unknown) => report("layer", error));
});
store.on(["timeMs"], showLayer);
store.on(["look"], (state, before) => {
  // Another product or mode is shown when its zoom limits are known.
  if (state.product === before.product && state.mode === before.mode) showLayer();
});
store.on(["look", "mode"], readyLegend);
// A new wish is a new chance: an old complaint about pictures would only confuse.
store.on(["mode", "product", "timeMs", "look"], () => {
  notices.clear("tiles");
  notices.clear("legend");
});
store.on(["product", "timeMs"], () => notices.clear("outside"));
keepAddress();
void begin();
new Updates((news) => void renew(news));

function makeGlobe(): Globe {
  try {
    const made = new Globe(byId("globe"), byId("credits"), chooseQuality());
    made.scene.renderError.addEventListener((_scene: unknown, error: unknown) => {
      notices.show("render", `The globe cannot be drawn any more (${String(error)}). Load the page again.`);
    });
    return made;
  } catch (error) {
    notices.show(
      "webgl",
      "This browser cannot draw the globe: it needs WebGL 2. Tables and tiles of the server work without it.",
    );
    throw error;
  }
}

/** Loads what the page needs; again when a lost server is back, where a whole picture in sight is kept. */
async function begin(): Promise<void> {
  try {
    const [products, named] = await Promise.all([api.products(), api.palettes()]);
    catalogue = new Catalogue(products, catalogue);
    palettes = named;
  } catch (error) {
    report("products", error);
    return;
  }
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
  const look = drawable(store.state.look);
  if (store.state.product === chosen.id) {
    store.set({ look });
    useProduct();
    bringIntoSight();
  } else store.set({ product: chosen.id, look: wanted === null ? look : withoutColours(look) });
  await catalogue.learn(chosen.id, store.state.mode).catch((error: unknown) => report("layer", error));
  showLayer();
  void presenter.idle().then(() => probe.setReady());
  await loadAside();
}

/** Regions and the check table: the globe does not wait for them. */
async function loadAside(): Promise<void> {
  // Nobody publishes budgets of made-up data.
  const isAllSynthetic = catalogue.products.every((each) => each.synthetic);
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

/** Shows what is new in the page that is open: what did not change stays as it is. */
async function renew(all: News[]): Promise<void> {
  const before = product();
  for (const news of all) {
    // Told again of a version that is known: what lifts its particles is there now.
    if (catalogue.find(news.product)?.manifest === news.manifest) catalogue.revise(news.product);
  }
  const relief = store.state.look.relief;
  const isReliefNew = before !== undefined && all.some((news) => news.product === relief);
  if (isReliefNew) catalogue.revise(before.id);
  try {
    catalogue = new Catalogue(await api.products(), catalogue);
  } catch (error) {
    report("products", error);
    return;
  }
  notices.tell("news", `New data: ${catalogue.titlesOf(all.map((news) => news.product)).join(", ")}`);
  controls.setProducts(catalogue.products);
  const now = product();
  if (!now) return;
  if (!before) {
    await begin();
    return;
  }
  controls.setProduct(now);
  lookPanel.draw();
  const shown = all.filter((news) => news.product === now.id);
  if (isReliefNew) showLayer();
  if (shown.length === 0) return;
  if (JSON.stringify(before.steps) !== JSON.stringify(now.steps)) useProduct();
  if (shown.some((news) => touches(news, store.state.timeMs))) showLayer();
  await Promise.all([placePanel.refresh(), budgetPanel.renew()]);
}

function useProduct(): void {
  const chosen = product();
  if (!chosen) return;
  controls.setProduct(chosen);
  byId("synthetic").hidden = !chosen.synthetic;
  document.body.classList.toggle("is-synthetic", chosen.synthetic);
  document.title = `${titleText(chosen)} – Fluxglobe`;
  const known = steps();
  timeline.setSteps(known);
  budgetPanel.setSteps(known);
  lookPanel.draw();
  if (known.length === 0) notices.show("steps", `“${chosen.title}” has no periods yet.`);
  else notices.clear("steps");
  const mode = chosen.modes.includes(store.state.mode) ? store.state.mode : (chosen.modes[0] ?? "map");
  const wantedMs = askedMs ?? Number.NaN;
  askedMs = undefined;
  const isAsked = Number.isFinite(wantedMs);
  // Another product's years say nothing here: unless its address names an instant, it begins with its own first picture.
  const timeMs = isAsked
    ? clampToRange(known, wantedMs)
    : isOutside(known, store.state.timeMs) || !Number.isFinite(store.state.timeMs)
      ? (known[0]?.midMs ?? Number.NaN)
      : store.state.timeMs;
  store.set({ mode, timeMs });
  readyLegend();
  if (isAsked && isOutside(known, wantedMs)) notices.show("outside", outsideText(titleText(chosen), known, wantedMs));
}

/** Only for a product that was chosen: new data of the one in sight must not turn the globe. */
function bringIntoSight(): void {
  const bounds = product()?.bounds;
  if (bounds && !contains(bounds, store.state.camera) && asked.camera === undefined) globe.lookAt(bounds);
}

function showLayer(): void {
  const spec = catalogue.layerAt(store.state, store.state.timeMs);
  if (spec) presenter.want(spec);
}

/** A picture that is still to come brings its legend with it; until there is any, the legend is that of what is waited for. */
function readyLegend(): void {
  const { product: id, mode } = store.state;
  if (!product() || id === null) return;
  const layer = { product: id, mode, look: catalogue.lookIn(mode, store.state) };
  if (stage.shownKey === undefined) void legend.show(layer);
  else legend.learn(layer);
}

/** An address may name a palette or a relief that is not here. */
function drawable(look: Look): Look {
  const names = palettes.map((palette) => palette.name);
  return possible(look, names, catalogue.reliefs.map((product) => product.id));
}

function keepAddress(): void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  store.on(["product", "mode", "timeMs", "camera", "opacity", "look", "place", "tab", "region", "observations"], () => {
    timer ??= setTimeout(() => {
      timer = undefined;
      history.replaceState(null, "", encodeHash(store.state));
    }, ADDRESS_PAUSE_MS);
  });
  // A hash that is typed or pasted into an open page is meant as a whole new view.
  window.addEventListener("hashchange", () => {
    const change = decodeHash(location.hash);
    let look = drawable(change.look ?? INITIAL.look);
    if (change.product !== undefined && !catalogue.find(change.product)) {
      delete change.product;
      look = withoutColours(look);
    }
    if (change.camera) globe.view = change.camera;
    askedMs = change.timeMs;
    const { region, opacity, observations } = INITIAL;
    store.set({ place: null, tab: null, region, opacity, observations, ...change, look });
    // A change of product has looked at the instant already.
    if (askedMs !== undefined) useProduct();
  });
}
