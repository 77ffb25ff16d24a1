//! The live picture: camera, time and look in, the server's picture of them over the globe out; where none comes, tiles on the globe.
import { address } from "../api/client";
import type { Drawn } from "../globe/drawn";
import type { Globe } from "../globe/globe";
import type { LayerSpec } from "../globe/layer";
import type { Presenter } from "../globe/presenter";
import type { Inventory } from "../state/inventory";
import type { Store } from "../state/store";
import { type Shot, StreamClient } from "./client";
import { meshOf } from "./mesh";
import { FADE_MS, type Overlay } from "./overlay";
import { paint } from "./painter";
import { decode, type Picture } from "./picture";
import { type Pose, poseOf } from "./pose";
import { Rate } from "./rate";
import { isAlike, isRaised, isSameCamera, type Scene, viewAddress } from "./view";

/**
 * A picture moved to another camera is good enough while what stands up leans by no more than this, and it covers this share
 * of the window. Where the globe below has no tiles a worse one is still better than none.
 */
const FITS = {
  overTiles: { mostLean: 0.4, leastCover: 0.45 },
  overNothing: { mostLean: 2, leastCover: 0.2 },
};
/** Younger than this a picture may lie where it was taken although the camera went on. */
const FRESH_MS = 300;
/** With nothing in sight a reader waits this long for a picture: then tiles come in its place. */
const WAIT_LIMIT_MS = 8_000;
/** The page does not wait longer than this to learn whether there is a stream. */
const OFFER_MS = 1_500;

export interface Surroundings {
  store: Store;
  inventory: Inventory;
  globe: Globe;
  presenter: Presenter;
  overlay: Overlay;
  marks: () => readonly Drawn[];
  /** The globe below has tiles of just that. */
  hasTiles: (spec: LayerSpec) => boolean;
  /** Another picture came into sight over the globe. */
  onShow: (spec: LayerSpec) => void;
  /** Nothing of the globe is in sight any more, or it is in sight again. */
  onCover: (isCovered: boolean) => void;
}

export class Live {
  readonly rate = new Rate();
  readonly #parts: Surroundings;
  readonly #client: StreamClient<Scene, ImageBitmap>;
  #shown: { picture: Picture; scene: Scene; pose: Pose; askedMs: number } | undefined;
  #isRunning = false;
  #isOpening = false;
  #isShown = false;
  #waitingSinceMs: number | undefined;
  #isRefused = false;
  #wasCarried = false;
  #isAbsent = false;
  #revision = 0;
  #painted = "";
  #cover: ReturnType<typeof setTimeout> | undefined;
  #paintedMarks: readonly Drawn[] = [];
  readonly #turns: ((isOpen: boolean) => void)[] = [];
  readonly #firsts: (() => void)[] = [];
  /** Told when pictures begin or end to carry the view. */
  onTurn: (isCarried: boolean) => void = () => undefined;

  constructor(parts: Surroundings) {
    this.#parts = parts;
    this.#client = new StreamClient<Scene, ImageBitmap>(
      {
        open: () => new WebSocket(address("stream").replace(/^http/, "ws")),
        decode,
        drop: (image) => image.close(),
        frame: (call) => requestAnimationFrame(call),
        nowMs: () => performance.now(),
      },
      {
        onShot: (shot) => this.#take(shot),
        onRefused: ({ status }) => {
          // Too much to do: the server tries again by itself.
          this.#isRefused = status !== 503;
          this.#judge();
        },
        onTurn: (isOpen) => {
          this.#isAbsent = !isOpen;
          for (const tell of this.#turns.splice(0)) tell(isOpen);
          this.#judge();
        },
      },
    );
    parts.store.on(["live", "mode", "product"], () => this.#follow());
  }

  /** Has this server a stream? Asked before the page decides how it opens. */
  offered(): Promise<boolean> {
    if (!this.#parts.store.state.live) return Promise.resolve(false);
    if (this.#client.isOpen) return Promise.resolve(true);
    this.#isOpening = true;
    this.#client.start();
    const answer = new Promise<boolean>((resolve) => {
      this.#turns.push(resolve);
      setTimeout(() => resolve(this.#client.isOpen), OFFER_MS);
    });
    return answer;
  }

  /** The page has opened: a stream that is of no use in the mode it opened in ends. */
  opened(): void {
    this.#isOpening = false;
    this.#follow();
  }

  /** Pictures come: tiles need not. */
  get isCarried(): boolean {
    return this.#isWanted && this.#client.isOpen && !this.#isRefused && !this.#isStarved;
  }

  /** The server was asked for a stream and has none, or none any more. */
  get isAbsent(): boolean {
    return this.#isAbsent;
  }

  /** Pictures of any instant and look come by themselves, in sight or about to be. */
  get isFollowing(): boolean {
    return this.isCarried;
  }

  /** How far what is in sight is behind what is asked for. */
  get lagMs(): number {
    return this.#client.lagMs;
  }

  get isShown(): boolean {
    return this.#isShown;
  }

  /** What is in sight over the globe; undefined where the globe itself is. */
  get picture(): Picture | undefined {
    return this.#isShown ? this.#shown?.picture : undefined;
  }

  /** Resolves when the first picture is in sight, or at once where none is to be had. */
  settled(): Promise<void> {
    if (!this.isCarried || this.#isShown) return Promise.resolve();
    return new Promise((resolve) => this.#firsts.push(resolve));
  }

  /** At once: another product's picture must not stay under a new product's legend. */
  clear(): void {
    this.#shown = undefined;
    this.#parts.overlay.clear();
    this.#turnTo(false);
  }

  get #isWanted(): boolean {
    const { live, mode } = this.#parts.store.state;
    const product = this.#parts.inventory.product;
    return live && isRaised(mode) && product !== undefined && product.modes.includes(mode);
  }

  get #isStarved(): boolean {
    return !this.#isShown && this.#waitingSinceMs !== undefined && performance.now() - this.#waitingSinceMs > WAIT_LIMIT_MS;
  }

  #follow(): void {
    if (this.#isWanted) {
      this.#client.start();
      if (!this.#isRunning) this.#run();
    } else if (!this.#isOpening) {
      this.#client.stop();
      this.#turnTo(false);
      this.#shown = undefined;
    }
    this.#judge();
  }

  #run(): void {
    this.#isRunning = this.#isWanted;
    if (!this.#isRunning) return;
    this.#tick();
    requestAnimationFrame(() => this.#run());
  }

  #tick(): void {
    const scene = this.#scene();
    if (!scene) return;
    const revised = scene.spec.revision !== this.#revision;
    this.#revision = scene.spec.revision;
    if (revised) this.#client.forget();
    this.#client.ask(scene, viewAddress(scene));
    if (this.#client.isAnswered || !this.#client.isOpen) this.#waitingSinceMs = undefined;
    else this.#waitingSinceMs ??= performance.now();
    if (this.isCarried !== this.#wasCarried) this.#judge();
    this.#place(scene);
  }

  #scene(): Scene | undefined {
    const { store, inventory, globe } = this.#parts;
    const spec = inventory.layerAt(store.state.timeMs);
    const { clientWidth: width, clientHeight: height } = globe.canvas;
    if (!spec || width === 0 || height === 0) return undefined;
    return { spec, camera: globe.view, width, height, density: window.devicePixelRatio };
  }

  #take({ picture, image, scene, askedMs }: Shot<Scene, ImageBitmap>): void {
    const { overlay, inventory, store } = this.#parts;
    this.#waitingSinceMs = undefined;
    this.#isRefused = false;
    // Told of one that is not shown too: the server waits for no other answer.
    requestAnimationFrame(() => this.#client.seen(picture.id));
    const now = inventory.layerAt(store.state.timeMs);
    if (!this.#isWanted || !now || !isAlike(now, scene.spec)) {
      image.close();
      return;
    }
    overlay.draw(image, scene.width, scene.height);
    requestAnimationFrame(() => this.rate.add(askedMs, performance.now()));
    this.#shown = { picture, scene, askedMs, pose: poseOf(scene.camera, scene.width, scene.height) };
    const current = this.#scene();
    if (current) this.#place(current);
    if (this.#isShown) this.#parts.onShow(scene.spec);
    this.#judge();
  }

  /** Lays the picture under the eye where it fits, else fades to the globe. After a break it stays until tiles take its place. */
  #place(scene: Scene): void {
    const { overlay, hasTiles } = this.#parts;
    const shown = this.#shown;
    if (!shown) return;
    const pose = poseOf(scene.camera, scene.width, scene.height);
    const isBare = !hasTiles(scene.spec);
    const isNeeded = this.#client.isOpen || isBare;
    if (isSameCamera(shown.scene, scene)) {
      overlay.rest();
      this.#turnTo(isNeeded || shown.scene.spec.timeIso === scene.spec.timeIso);
    } else {
      const mesh = meshOf(shown.pose, pose);
      const { mostLean, leastCover } = isBare ? FITS.overNothing : FITS.overTiles;
      const fits = mesh.lean < mostLean && mesh.cover > leastCover;
      overlay.move(mesh, Math.round(scene.width * scene.density), Math.round(scene.height * scene.density));
      this.#turnTo(isNeeded && (fits || performance.now() - shown.askedMs < FRESH_MS));
    }
    this.#paint(scene, pose);
  }

  #paint({ camera, width, height, density }: Scene, pose: Pose): void {
    const marks = this.#parts.marks();
    const painted = [...Object.values(camera), width, height, density].join();
    const isSame = marks.length === this.#paintedMarks.length && marks.every((each, i) => each === this.#paintedMarks[i]);
    if (painted === this.#painted && isSame) return;
    this.#painted = painted;
    this.#paintedMarks = marks;
    const paper = this.#parts.overlay.paper(width, height, density);
    if (paper) paint(paper, pose, marks);
  }

  #turnTo(isShown: boolean): void {
    if (this.#isShown === isShown) return;
    this.#isShown = isShown;
    const { overlay, onCover, onShow } = this.#parts;
    overlay.fade(isShown);
    clearTimeout(this.#cover);
    // As long as the picture fades in, what lies below is seen through it.
    if (isShown) this.#cover = setTimeout(() => onCover(true), FADE_MS);
    else onCover(false);
    if (isShown && this.#shown) onShow(this.#shown.scene.spec);
    if (isShown) for (const tell of this.#firsts.splice(0)) tell();
  }

  #judge(): void {
    const { isCarried } = this;
    this.#wasCarried = isCarried;
    this.#parts.presenter.isHeld = isCarried;
    if (!isCarried) for (const tell of this.#firsts.splice(0)) tell();
    this.onTurn(isCarried);
  }
}
