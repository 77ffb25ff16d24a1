//! Pictures over the globe: the newest picture and for which camera in, what the eye sees out. The last one stays until the next is there.
import type { Mesh } from "./mesh";
import { Mover } from "./mover";

/** The style sheet fades between the globe and what has this class, for so long. */
const SHOWN = "shown";
export const FADE_MS = 160;

export class Overlay {
  readonly #root: HTMLElement;
  readonly #picture = document.createElement("canvas");
  readonly #mover = new Mover();
  readonly #marks = document.createElement("canvas");
  readonly #pixels: CanvasRenderingContext2D | null;
  readonly #ink: CanvasRenderingContext2D | null;
  #isEmpty = true;
  /** The mover has not seen the picture yet. */
  #isNew = true;

  constructor(root: HTMLElement) {
    this.#root = root;
    // Black lies behind both: JPEG has no alpha, and the sky must not change when the full picture comes.
    this.#pixels = this.#picture.getContext("2d", { alpha: false });
    this.#ink = this.#marks.getContext("2d");
    this.#picture.className = "picture";
    root.append(this.#picture, this.#mover.canvas, this.#marks);
  }

  get isShown(): boolean {
    return !this.#isEmpty && this.#root.classList.contains(SHOWN);
  }

  /** `width` and `height` are those of the window that the picture was asked for. */
  draw(image: ImageBitmap, width: number, height: number): void {
    const { style } = this.#picture;
    if (this.#picture.width !== image.width || this.#picture.height !== image.height) {
      this.#picture.width = image.width;
      this.#picture.height = image.height;
    }
    this.#pixels?.clearRect(0, 0, image.width, image.height);
    this.#pixels?.drawImage(image, 0, 0);
    image.close();
    style.width = `${width}px`;
    style.height = `${height}px`;
    this.#isEmpty = false;
    this.#isNew = true;
  }

  /** The picture as it is, for the camera that it was taken by. */
  rest(): void {
    this.#picture.hidden = false;
    this.#mover.canvas.hidden = true;
  }

  /** The picture through a mesh, for another camera. */
  move(mesh: Mesh, width: number, height: number): void {
    if (this.#isNew) this.#mover.take(this.#picture);
    this.#isNew = false;
    this.#mover.draw(mesh, width, height);
    this.#picture.hidden = true;
    this.#mover.canvas.hidden = false;
  }

  fade(isIn: boolean): void {
    this.#root.classList.toggle(SHOWN, isIn && !this.#isEmpty);
  }

  /** At once: another product's picture must not stay. */
  clear(): void {
    this.#isEmpty = true;
    this.#root.classList.remove(SHOWN);
    this.#picture.width = 1;
    this.#picture.height = 1;
  }

  /** Empty paper for marks, of the window's size. */
  paper(width: number, height: number, density: number): CanvasRenderingContext2D | null {
    const [wide, high] = [Math.round(width * density), Math.round(height * density)];
    if (this.#marks.width !== wide || this.#marks.height !== high) {
      this.#marks.width = wide;
      this.#marks.height = high;
    }
    this.#ink?.setTransform(density, 0, 0, density, 0, 0);
    this.#ink?.clearRect(0, 0, width, height);
    return this.#ink;
  }
}
