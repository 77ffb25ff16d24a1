//! Marks on the globe: the chosen place, the grid cell its series belongs to, and the budget's region as an outline.
import { Cartesian3, Color, Material, PointPrimitiveCollection, PolylineCollection, type Scene } from "cesium";
import type { Place } from "../state/camera";
import { type Bounds, type LonLat, outline } from "./box";

const PLACE_COLOUR = "#ffd166";
const REGION_COLOUR = "#7fe7ff";
/** Lines float a little above the ellipsoid so that the globe's facets do not cut into them. */
const LINE_HEIGHT_M = 9_000;

export class Marks {
  readonly #points: PointPrimitiveCollection;
  readonly #lines: PolylineCollection;
  readonly #scene: Scene;

  constructor(scene: Scene) {
    this.#scene = scene;
    this.#points = scene.primitives.add(new PointPrimitiveCollection()) as PointPrimitiveCollection;
    this.#lines = scene.primitives.add(new PolylineCollection()) as PolylineCollection;
  }

  place(place: Place | null): void {
    this.#points.removeAll();
    if (place) {
      this.#points.add({
        position: Cartesian3.fromDegrees(place.lon, place.lat, LINE_HEIGHT_M),
        color: Color.fromCssColorString(PLACE_COLOUR),
        outlineColor: Color.fromCssColorString("#0b1a26"),
        outlineWidth: 2.5,
        pixelSize: 13,
      });
    }
    this.#scene.requestRender();
  }

  region(bounds: Bounds | null): void {
    this.#lines.removeAll();
    for (const line of bounds ? outline(bounds) : []) this.#line(line);
    this.#scene.requestRender();
  }

  #line(points: readonly LonLat[]): void {
    this.#lines.add({
      positions: points.map((point) => Cartesian3.fromDegrees(point.lon, point.lat, LINE_HEIGHT_M)),
      width: 2.2,
      material: Material.fromType("Color", { color: Color.fromCssColorString(REGION_COLOUR) }),
    });
  }
}
