//! Pointer on the globe: a click gives a place; in drawing mode a drag gives a box.
import { ScreenSpaceEventHandler, ScreenSpaceEventType } from "cesium";
import type { Place } from "../state/camera";
import { type Bounds, boxFromCorners } from "./box";
import type { Globe } from "./globe";

interface Drawing {
  start: Place | undefined;
  onChange: (box: Bounds) => void;
  onEnd: (box: Bounds | undefined) => void;
}

export class Pointer {
  #drawing: Drawing | undefined;
  readonly #globe: Globe;

  /** `onThing` says whether something on the globe was hit; only the globe itself is a place. */
  constructor(
    globe: Globe,
    onPlace: (place: Place) => void,
    onThing: (position: { x: number; y: number }) => boolean,
  ) {
    this.#globe = globe;
    const handler = new ScreenSpaceEventHandler(globe.canvas);
    handler.setInputAction((event: ScreenSpaceEventHandler.PositionedEvent) => {
      if (this.#drawing || onThing(event.position)) return;
      const place = globe.pick(event.position);
      if (place) onPlace(place);
    }, ScreenSpaceEventType.LEFT_CLICK);
    handler.setInputAction((event: ScreenSpaceEventHandler.PositionedEvent) => {
      if (this.#drawing) this.#drawing.start = globe.pick(event.position);
    }, ScreenSpaceEventType.LEFT_DOWN);
    handler.setInputAction(
      (event: ScreenSpaceEventHandler.MotionEvent) => this.#drag(event.endPosition),
      ScreenSpaceEventType.MOUSE_MOVE,
    );
    handler.setInputAction(
      (event: ScreenSpaceEventHandler.PositionedEvent) => this.#release(event.position),
      ScreenSpaceEventType.LEFT_UP,
    );
    window.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && this.#drawing) this.#end(undefined);
    });
  }

  /** The next drag draws a box instead of turning the globe; Escape leaves. */
  drawBox(onChange: (box: Bounds) => void, onEnd: (box: Bounds | undefined) => void): void {
    if (this.#drawing) this.#end(undefined);
    this.#drawing = { start: undefined, onChange, onEnd };
    this.#globe.scene.screenSpaceCameraController.enableInputs = false;
    this.#globe.canvas.classList.add("drawing");
  }

  #drag(position: { x: number; y: number }): void {
    const box = this.#boxTo(position);
    if (box) this.#drawing?.onChange(box);
  }

  #release(position: { x: number; y: number }): void {
    if (!this.#drawing?.start) return;
    this.#end(this.#boxTo(position));
  }

  #boxTo(position: { x: number; y: number }): Bounds | undefined {
    const start = this.#drawing?.start;
    const end = start && this.#globe.pick(position);
    if (!start || !end) return undefined;
    const box = boxFromCorners(start, end);
    return box[0] === box[2] || box[1] === box[3] ? undefined : box;
  }

  #end(box: Bounds | undefined): void {
    const drawing = this.#drawing;
    this.#drawing = undefined;
    this.#globe.scene.screenSpaceCameraController.enableInputs = true;
    this.#globe.canvas.classList.remove("drawing");
    drawing?.onEnd(box);
  }
}
