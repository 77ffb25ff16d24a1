//! The page's wiring: store, globe, layers and cards are made and joined; what they show is decided in `viewer.ts`.
import "cesium/Build/Cesium/Widgets/CesiumWidget/CesiumWidget.css";
import "./style/base.css";
import "./style/fields.css";
import "./style/layer.css";
import "./style/analysis.css";
import "./style/look.css";
import "./style/stream.css";
import "./style/time.css";
import "./style/messages.css";
import "./style/phone.css";
import { Updates } from "./api/updates";
import { CameraButtons } from "./globe/camera-buttons";
import { Globe } from "./globe/globe";
import { layerKey } from "./globe/layer";
import { Marks } from "./globe/marks";
import { Pointer } from "./globe/pointer";
import { Presenter } from "./globe/presenter";
import { chooseQuality } from "./globe/quality";
import { TileSources } from "./globe/sources";
import { LayerStage } from "./globe/stage";
import { TileCounts } from "./globe/tiles";
import { LegendCard } from "./look/legend-card";
import { offerOf } from "./look/offer";
import { LookPanel } from "./look/panel";
import { Connection } from "./page/connection";
import { byId } from "./page/dom";
import { Notices } from "./page/notices";
import { BudgetPanel } from "./panels/budget";
import { Controls } from "./panels/controls";
import { ObservationLayer } from "./panels/observation-layer";
import { Panels } from "./panels/panels";
import { PlacePanel } from "./panels/place";
import { ViewDialog } from "./panels/view";
import { installProbe } from "./probe";
import { keepAddress } from "./state/address-bar";
import { FLUX, isLinear } from "./state/catalogue";
import { decodeHash } from "./state/hash";
import { Inventory } from "./state/inventory";
import { INITIAL, Store } from "./state/store";
import { Live } from "./stream/live";
import { Overlay } from "./stream/overlay";
import { Readout } from "./stream/readout";
import { LiveSwitch } from "./stream/switch";
import { Playback } from "./time/playback";
import { rangeOf } from "./time/steps";
import { Timeline } from "./time/timeline";
import { Viewer } from "./viewer";

const asked = decodeHash(location.hash);
const store = new Store({ ...INITIAL, ...asked });
const inventory = new Inventory(store);
const notices = new Notices();

const globe = makeGlobe();
const counts = new TileCounts();
const connection = new Connection(
  notices,
  () => store.set({ playing: false }),
  () => {
    // What loads may be waiting for tiles that already failed while the server was away.
    presenter.abandon();
    void viewer.begin();
  },
);
const report = (key: string, error: unknown) => connection.report(key, error);
const sources = new TileSources();
const stage = new LayerStage(globe.scene, sources, counts, store.state.opacity, {
  onRefused: (error) => connection.layerRefused(error),
  onFailed: (failure) => void connection.tileFailed(failure),
});
const presenter = new Presenter(stage);
const marks = new Marks(globe.scene);
const pointer = new Pointer(
  globe,
  (place) => store.set({ place, tab: "place" }),
  (position) => observed.choose(position),
);

const live = new Live({
  store,
  inventory,
  globe,
  presenter,
  overlay: new Overlay(byId("overlay")),
  marks: () => [marks.drawn, observed.drawn],
  hasTiles: (spec) => stage.shownKey === layerKey(spec),
  onShow: (spec) => void legend.show(spec),
  onCover: (isCovered) => {
    stage.isCovered = isCovered;
    if (!isCovered && stage.shown) void legend.show(stage.shown);
  },
});
const isFollowed = () => live.isFollowing;

const view = new ViewDialog(
  store,
  () => inventory.product?.modes ?? [],
  () => inventory.product?.synthetic ?? false,
  (mode) => inventory.viewIn(mode),
  () => rangeOf(inventory.steps),
);
const controls = new Controls(byId("controls"), store, () => view.open());
const legend = new LegendCard(
  controls.legend,
  (id, mode, manifest) => inventory.catalogue.usualLegend(id, mode, manifest),
  (id) => inventory.catalogue.codesOf(id),
  report,
);
const timeline = new Timeline(byId("timeline"), store, isFollowed);
const panels = new Panels(byId("panels"), store);
const observed = new ObservationLayer(controls.observations, globe, store, panels, report);
const placePanel = new PlacePanel(panels.bodies.place, {
  store,
  steps: () => inventory.steps,
  label: () => inventory.product?.legend.label ?? "",
  bounds: () => inventory.product?.bounds_deg,
  bringIntoSight: (place) => globe.bringIntoSight(place),
  onError: report,
});
const budgetPanel = new BudgetPanel(panels.bodies.budget, {
  store,
  isFlux: () => inventory.product?.quantity === FLUX,
  hasMean: () => inventory.product !== undefined && isLinear(inventory.product.quantity),
  drawBox: (onChange, onEnd) => pointer.drawBox(onChange, onEnd),
  markRegion: (box) => marks.region(box),
  onError: report,
});
const lookPanel = new LookPanel(
  panels.bodies.look,
  store,
  () => offerOf(inventory.catalogue, inventory.palettes, store.state),
  isFollowed,
);
new CameraButtons(byId("camera"), globe);
new Playback(
  store,
  presenter,
  () => inventory.steps,
  (timeMs) => inventory.layerAt(timeMs),
  live,
  (timeMs) => controls.waitFor(timeMs),
);
new LiveSwitch(controls.live, store, live);
new Readout(byId("app"), { rate: live.rate, picture: () => live.picture, tiles: () => stage.load });
const probe = installProbe(
  store,
  counts,
  globe,
  () => stage.shownKey,
  () => observed.platforms,
  live,
);

controls.watch(counts);
// Below a live picture tiles change unseen.
stage.onReveal = (spec) => !live.isShown && void legend.show(spec);
globe
  .addBaseImagery()
  .catch(() => notices.show("base", "The base map is missing from this server; data is drawn on plain water."));
globe.view = store.state.camera;
globe.scene.camera.percentageChanged = 0.01;
globe.scene.camera.changed.addEventListener(() => store.set({ camera: globe.view }));
globe.scene.camera.moveEnd.addEventListener(() => store.set({ camera: globe.view }));

const viewer = new Viewer(
  {
    store,
    inventory,
    notices,
    globe,
    sources,
    stage,
    presenter,
    live,
    marks,
    controls,
    legend,
    timeline,
    panels,
    placePanel,
    budgetPanel,
    lookPanel,
    report,
    onReady: () => probe.setReady(),
  },
  asked,
);
keepAddress(store, (change) => viewer.goTo(change));
void viewer.begin();
new Updates((news, isAnew) => void viewer.renew(news, isAnew));

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
