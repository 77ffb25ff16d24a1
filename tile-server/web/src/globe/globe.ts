//! The globe itself: Cesium with its own Natural Earth pictures and nothing from outside, drawn only when something changes.
import {
  Cartesian3,
  Cartographic,
  CesiumWidget,
  Color,
  Credit,
  Ellipsoid,
  EllipsoidTerrainProvider,
  ImageryLayer,
  Ion,
  Math as CesiumMath,
  PerspectiveFrustum,
  SceneTransforms,
  TileMapServiceImageryProvider,
  buildModuleUrl,
  type Scene,
} from "cesium";
import { wrapLon } from "../page/format";
import { type CameraView, HOME, OPENING_DEG, type Place, SPHERE_RADIUS_M } from "../state/camera";
import type { Bounds } from "./box";

/** The base picture is dimmed: the data's colours are what is to be read. */
const BASE_LOOK = { brightness: 0.62, saturation: 0.55, contrast: 1.08, gamma: 1.0 };
const MIN_HEIGHT_M = 50_000;
const MAX_HEIGHT_M = 60_000_000;
const ZOOM_STEP = 0.35;
/** Of the camera by one arrow key. */
const LOOK_STEP_DEG = 3;

export interface GlobeOptions {
  /** Larger is coarser and asks for fewer tiles; 2 is Cesium's own. */
  screenSpaceError: number;
  /** Part of the screen's resolution that is drawn. */
  resolutionScale: number;
  /** Stars and the glow of the air: left out where drawing is done by the processor. */
  hasSky: boolean;
}

export class Globe {
  readonly widget: CesiumWidget;
  /** Where the page began. */
  start: CameraView = HOME;

  constructor(container: HTMLElement, credits: HTMLElement, options: GlobeOptions) {
    // No token, so that nothing in the library could reach its maker's service even by mistake.
    Ion.defaultAccessToken = "";
    // The server draws a sphere: on an ellipsoid its coasts would lie up to 20 km beside these.
    Ellipsoid.default = new Ellipsoid(SPHERE_RADIUS_M, SPHERE_RADIUS_M, SPHERE_RADIUS_M);
    this.widget = new CesiumWidget(container, {
      baseLayer: false,
      terrainProvider: new EllipsoidTerrainProvider(),
      creditContainer: credits,
      requestRenderMode: true,
      // The scene's own clock means nothing here: product time lives in the state, so time alone never redraws.
      maximumRenderTimeChange: Number.POSITIVE_INFINITY,
      scene3DOnly: true,
      orderIndependentTranslucency: false,
      shouldAnimate: false,
      msaaSamples: options.hasSky ? 4 : 1,
      showRenderLoopErrors: false,
      contextOptions: { webgl: { powerPreference: "high-performance" } },
      ...(options.hasSky ? {} : { skyBox: false, skyAtmosphere: false }),
    });
    this.widget.resolutionScale = options.resolutionScale;
    this.#dress(options);
    this.#keys();
    new ResizeObserver(() => this.#lens(container)).observe(container);
    this.#lens(container);
  }

  get scene(): Scene {
    return this.widget.scene;
  }

  get canvas(): HTMLCanvasElement {
    return this.widget.canvas;
  }

  async addBaseImagery(): Promise<void> {
    const provider = await TileMapServiceImageryProvider.fromUrl(buildModuleUrl("Assets/Textures/NaturalEarthII"), {
      credit: new Credit("Natural Earth II", true),
    });
    this.scene.imageryLayers.add(new ImageryLayer(provider, BASE_LOOK), 0);
    this.scene.requestRender();
  }

  /** Where a ray through the canvas point meets the ellipsoid; undefined beside the globe. */
  pick(position: { x: number; y: number }): Place | undefined {
    const hit = this.scene.camera.pickEllipsoid(position as never, this.scene.globe.ellipsoid);
    if (!hit) return undefined;
    const at = Cartographic.fromCartesian(hit);
    return { lon: CesiumMath.toDegrees(at.longitude), lat: CesiumMath.toDegrees(at.latitude) };
  }

  /** Canvas point of a place in CSS pixels; undefined when it lies on the far side. */
  project(place: Place): { x: number; y: number } | undefined {
    const position = Cartesian3.fromDegrees(place.lon, place.lat);
    const up = this.scene.globe.ellipsoid.geodeticSurfaceNormal(position);
    const toCamera = Cartesian3.subtract(this.scene.camera.positionWC, position, new Cartesian3());
    if (Cartesian3.dot(up, toCamera) <= 0) return undefined;
    const point = SceneTransforms.worldToWindowCoordinates(this.scene, position);
    return point ? { x: point.x, y: point.y } : undefined;
  }

  get view(): CameraView {
    const { camera } = this.scene;
    const at = camera.positionCartographic;
    return {
      lon: CesiumMath.toDegrees(at.longitude),
      lat: CesiumMath.toDegrees(at.latitude),
      heightKm: at.height / 1000,
      // At the zenith heading and roll are one and the same turn; what is read back must not wander between 0 and 360.
      headingDeg: CesiumMath.toDegrees(CesiumMath.negativePiToPi(camera.heading)),
      pitchDeg: CesiumMath.toDegrees(camera.pitch),
      rollDeg: CesiumMath.toDegrees(CesiumMath.negativePiToPi(camera.roll)),
    };
  }

  set view(view: CameraView) {
    this.scene.camera.setView({ destination: destinationOf(view), orientation: orientationOf(view) });
    this.scene.requestRender();
  }

  fly(view: CameraView, seconds: number): void {
    this.scene.camera.flyTo({ destination: destinationOf(view), orientation: orientationOf(view), duration: seconds });
  }

  home(): void {
    this.fly(this.start, 1.2);
  }

  /** Turns north up over the place that is in sight now. */
  northUp(): void {
    const { lon, lat, heightKm } = this.view;
    this.fly({ lon, lat, heightKm, headingDeg: 0, pitchDeg: -90, rollDeg: 0 }, 0.6);
  }

  zoom(direction: 1 | -1): void {
    const view = this.view;
    const factor = direction > 0 ? 1 - ZOOM_STEP : 1 / (1 - ZOOM_STEP);
    const heightKm = Math.min(Math.max(view.heightKm * factor, MIN_HEIGHT_M / 1000), MAX_HEIGHT_M / 1000);
    this.fly({ ...view, heightKm }, 0.35);
  }

  /** Brings a product's box into sight unless its middle is there already. */
  lookAt(bounds: Bounds): void {
    const [west, south, east, north] = bounds;
    const span = Math.max(north - south, (((east - west) % 360) + 360) % 360 || 360);
    const lon = west + ((((east - west) % 360) + 360) % 360) / 2;
    // A box of 40 degrees fills the window from about 4800 km; nearer or further in proportion.
    const heightKm = Math.min(HOME.heightKm, Math.max(800, span * 120));
    this.fly({ lon, lat: (south + north) / 2, heightKm, headingDeg: 0, pitchDeg: -90, rollDeg: 0 }, 1.2);
  }

  /** Flies over a place that is out of sight: on the far side, beyond the window's edge, or below a card. */
  bringIntoSight(place: Place): void {
    const point = this.project(place);
    const { left, top } = this.canvas.getBoundingClientRect();
    if (point && document.elementFromPoint(left + point.x, top + point.y) === this.canvas) return;
    const { heightKm } = this.view;
    this.fly({ lon: wrapLon(place.lon), lat: place.lat, heightKm, headingDeg: 0, pitchDeg: -90, rollDeg: 0 }, 1.2);
  }

  #dress(options: GlobeOptions): void {
    const { scene } = this;
    scene.globe.maximumScreenSpaceError = options.screenSpaceError;
    scene.globe.baseColor = Color.fromCssColorString("#0a2338");
    scene.backgroundColor = Color.fromCssColorString("#040b13");
    // Colours carry numbers here: no light, haze or ground glow may change them.
    scene.globe.enableLighting = false;
    scene.globe.showGroundAtmosphere = false;
    scene.globe.showWaterEffect = false;
    scene.fog.enabled = false;
    scene.highDynamicRange = false;
    if (scene.sun) scene.sun.show = false;
    if (scene.moon) scene.moon.show = false;
    const control = scene.screenSpaceCameraController;
    control.minimumZoomDistance = MIN_HEIGHT_M;
    control.maximumZoomDistance = MAX_HEIGHT_M;
    control.enableCollisionDetection = false;
  }

  /** Cesium's opening is that of the longer side. */
  #lens(container: HTMLElement): void {
    const [width, height] = [container.clientWidth, container.clientHeight];
    const { frustum } = this.scene.camera;
    if (width === 0 || height === 0 || !(frustum instanceof PerspectiveFrustum)) return;
    const stretch = Math.max(width, height) / Math.min(width, height);
    frustum.fov = 2 * Math.atan(Math.tan(CesiumMath.toRadians(OPENING_DEG / 2)) * stretch);
    this.scene.requestRender();
  }

  /** The globe takes the focus and turns by arrow keys, so that it can be used without a pointer. */
  #keys(): void {
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("aria-label", "Globe. Arrow keys turn it, with Shift they tilt and turn the camera, plus and minus zoom.");
    this.canvas.addEventListener("keydown", (event) => {
      const view = this.view;
      const turnDeg = Math.min(15, view.heightKm / 1200);
      const turns: Record<string, [number, number]> = {
        ArrowLeft: [-turnDeg, 0],
        ArrowRight: [turnDeg, 0],
        ArrowUp: [0, turnDeg],
        ArrowDown: [0, -turnDeg],
      };
      const turn = turns[event.key];
      if (turn && event.shiftKey) this.view = turned(view, turn);
      else if (turn) this.view = { ...view, lon: view.lon + turn[0], lat: Math.max(-89, Math.min(89, view.lat + turn[1])) };
      else if (event.key === "+" || event.key === "=") this.zoom(1);
      else if (event.key === "-") this.zoom(-1);
      else return;
      event.preventDefault();
    });
  }
}

/** The camera stays where it is and looks elsewhere. */
function turned(view: CameraView, [right, up]: readonly [number, number]): CameraView {
  const pitchDeg = view.pitchDeg + Math.sign(up) * LOOK_STEP_DEG;
  return {
    ...view,
    headingDeg: view.headingDeg + Math.sign(right) * LOOK_STEP_DEG,
    pitchDeg: Math.min(Math.max(pitchDeg, -90), 0),
  };
}

function destinationOf(view: CameraView): Cartesian3 {
  return Cartesian3.fromDegrees(view.lon, view.lat, view.heightKm * 1000);
}

function orientationOf(view: CameraView): { heading: number; pitch: number; roll: number } {
  const [heading, pitch, roll] = [view.headingDeg, view.pitchDeg, view.rollDeg].map(CesiumMath.toRadians) as [number, number, number];
  return { heading, pitch, roll };
}
