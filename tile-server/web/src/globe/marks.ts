//! Marks on the globe: the chosen place, the grid cell its series belongs to, and the budget's region as an outline.
import { Cartesian3, Color, Material, PointPrimitiveCollection, PolylineCollection, type Scene } from "cesium";
import type { Place } from "../state/camera";
import { type Bounds, outline } from "./box";
import type { Drawn, DrawnLine, DrawnPoint } from "./drawn";

const PLACE_COLOUR = "#ffd166";
const EDGE_COLOUR = "#0b1a26";
const REGION_COLOUR = "#7fe7ff";
/** Lines float a little above the ground so that the globe's facets do not cut into them. */
const LINE_HEIGHT_M = 9_000;

export class Marks {
  #drawn: Drawn = { lines: [], points: [] };
  readonly #points: PointPrimitiveCollection;
  readonly #lines: PolylineCollection;
  readonly #scene: Scene;

  constructor(scene: Scene) {
    this.#scene = scene;
    this.#points = scene.primitives.add(new PointPrimitiveCollection()) as PointPrimitiveCollection;
    this.#lines = scene.primitives.add(new PolylineCollection()) as PolylineCollection;
  }

  /** Another one after every change. */
  get drawn(): Drawn {
    return this.#drawn;
  }

  place(place: Place | null): void {
    const points = place ? [{ ...place, colour: PLACE_COLOUR, edge: EDGE_COLOUR, edgePx: 2.5, sizePx: 13 }] : [];
    this.#drawn = { ...this.#drawn, points };
    this.#points.removeAll();
    for (const point of points) this.#point(point);
    this.#scene.requestRender();
  }

  region(bounds: Bounds | null): void {
    const lines = (bounds ? outline(bounds) : []).map((points) => ({ points, colour: REGION_COLOUR, widthPx: 2.2 }));
    this.#drawn = { ...this.#drawn, lines };
    this.#lines.removeAll();
    for (const line of lines) this.#line(line);
    this.#scene.requestRender();
  }

  #point({ lon, lat, colour, edge, edgePx, sizePx }: DrawnPoint): void {
    this.#points.add({
      position: Cartesian3.fromDegrees(lon, lat, LINE_HEIGHT_M),
      color: Color.fromCssColorString(colour),
      outlineColor: Color.fromCssColorString(edge),
      outlineWidth: edgePx,
      pixelSize: sizePx,
    });
  }

  #line({ points, colour, widthPx }: DrawnLine): void {
    this.#lines.add({
      positions: points.map((point) => Cartesian3.fromDegrees(point.lon, point.lat, LINE_HEIGHT_M)),
      width: widthPx,
      material: Material.fromType("Color", { color: Color.fromCssColorString(colour) }),
    });
  }
}
