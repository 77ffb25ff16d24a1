//! Platforms on the globe: buoys, stations and casts as points, ships as tracks with their last place; a canvas point in, the platform there out.
import { Cartesian3, Color, Material, PointPrimitiveCollection, PolylineCollection, type Scene } from "cesium";
import type { Kind, Platform } from "../api/types";
import { denseLine } from "./box";

const COLOURS: Record<Kind, string> = { buoy: "#ffe08a", ship: "#ff9bd2", station: "#b7f28f", profile: "#c9b6ff" };
/** A little above the ellipsoid, and below the mark of a chosen place. */
const HEIGHT_M = 8_000;
/** A chord of this many degrees stays above the ellipsoid at that height. */
const STEP_DEG = 4;
/** Fingers are wide. */
const PICK_PX = 9;

export class PlatformLayer {
  readonly #scene: Scene;
  readonly #points: PointPrimitiveCollection;
  readonly #lines: PolylineCollection;

  constructor(scene: Scene) {
    this.#scene = scene;
    this.#lines = scene.primitives.add(new PolylineCollection()) as PolylineCollection;
    this.#points = scene.primitives.add(new PointPrimitiveCollection()) as PointPrimitiveCollection;
  }

  show(platforms: readonly Platform[], chosen: Platform | null): void {
    this.#points.removeAll();
    this.#lines.removeAll();
    for (const platform of platforms) this.#draw(platform, platform.id === chosen?.id);
    this.#scene.requestRender();
  }

  at(position: { x: number; y: number }): Platform | undefined {
    const picked = this.#scene.pick(position as never, PICK_PX, PICK_PX) as
      | { id?: unknown }
      | undefined;
    return isPlatform(picked?.id) ? picked.id : undefined;
  }

  #draw(platform: Platform, isChosen: boolean): void {
    const { lon_deg, lat_deg, kind } = platform.properties;
    const colour = Color.fromCssColorString(COLOURS[kind]);
    if (platform.geometry.type === "MultiLineString") {
      for (const line of platform.geometry.coordinates) {
        this.#lines.add({
          id: platform,
          positions: denseLine(line, STEP_DEG).map(([x, y]) => Cartesian3.fromDegrees(x, y, HEIGHT_M)),
          width: isChosen ? 4 : 2,
          material: Material.fromType("Color", { color: colour }),
        });
      }
    }
    this.#points.add({
      id: platform,
      position: Cartesian3.fromDegrees(lon_deg, lat_deg, HEIGHT_M),
      color: colour,
      outlineColor: Color.fromCssColorString(isChosen ? "#ffffff" : "#0b1a26"),
      outlineWidth: 2,
      pixelSize: isChosen ? 13 : 9,
    });
  }
}

/** Other marks on the globe can be picked too; they carry nothing. */
function isPlatform(id: unknown): id is Platform {
  return typeof id === "object" && id !== null && "properties" in id;
}
