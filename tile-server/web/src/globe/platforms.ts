//! Platforms on the globe: buoys, stations and casts as points, ships as tracks with their last place; a canvas point in, the platform there out.
import { Cartesian3, Color, Material, PointPrimitiveCollection, PolylineCollection, type Scene } from "cesium";
import type { Kind, Platform } from "../api/types";
import { denseLine } from "./box";
import type { Drawn, DrawnLine, DrawnPoint } from "./drawn";

const COLOURS: Record<Kind, string> = { buoy: "#ffe08a", ship: "#ff9bd2", station: "#b7f28f", profile: "#c9b6ff" };
/** A little above the ellipsoid, and below the mark of a chosen place. */
const HEIGHT_M = 8_000;
/** A chord of this many degrees stays above the ellipsoid at that height. */
const STEP_DEG = 4;
/** Fingers are wide. */
const PICK_PX = 9;

export class PlatformLayer {
  #drawn: Drawn = { lines: [], points: [] };
  readonly #scene: Scene;
  readonly #points: PointPrimitiveCollection;
  readonly #lines: PolylineCollection;

  constructor(scene: Scene) {
    this.#scene = scene;
    this.#lines = scene.primitives.add(new PolylineCollection()) as PolylineCollection;
    this.#points = scene.primitives.add(new PointPrimitiveCollection()) as PointPrimitiveCollection;
  }

  /** Another one after every change. */
  get drawn(): Drawn {
    return this.#drawn;
  }

  show(platforms: readonly Platform[], chosen: Platform | null): void {
    this.#points.removeAll();
    this.#lines.removeAll();
    const drawn = platforms.map((platform) => this.#draw(platform, platform.id === chosen?.id));
    this.#drawn = { lines: drawn.flatMap(({ lines }) => lines), points: drawn.map(({ point }) => point) };
    this.#scene.requestRender();
  }

  at(position: { x: number; y: number }): Platform | undefined {
    const picked = this.#scene.pick(position as never, PICK_PX, PICK_PX) as
      | { id?: unknown }
      | undefined;
    return isPlatform(picked?.id) ? picked.id : undefined;
  }

  #draw(platform: Platform, isChosen: boolean): { lines: DrawnLine[]; point: DrawnPoint } {
    const { lon_deg, lat_deg, kind } = platform.properties;
    const colour = COLOURS[kind];
    const tracks = platform.geometry.type === "MultiLineString" ? platform.geometry.coordinates : [];
    const lines = tracks.map((track) => {
      const points = denseLine(track, STEP_DEG).map(([lon, lat]) => ({ lon, lat }));
      return { points, colour, widthPx: isChosen ? 4 : 2 };
    });
    const edge = isChosen ? "#ffffff" : "#0b1a26";
    const point = { lon: lon_deg, lat: lat_deg, colour, edge, edgePx: 2, sizePx: isChosen ? 13 : 9 };
    for (const line of lines) {
      this.#lines.add({
        id: platform,
        positions: line.points.map(({ lon, lat }) => Cartesian3.fromDegrees(lon, lat, HEIGHT_M)),
        width: line.widthPx,
        material: Material.fromType("Color", { color: Color.fromCssColorString(colour) }),
      });
    }
    this.#points.add({
      id: platform,
      position: Cartesian3.fromDegrees(lon_deg, lat_deg, HEIGHT_M),
      color: Color.fromCssColorString(colour),
      outlineColor: Color.fromCssColorString(edge),
      outlineWidth: point.edgePx,
      pixelSize: point.sizePx,
    });
    return { lines, point };
  }
}

/** Other marks on the globe can be picked too; they carry nothing. */
function isPlatform(id: unknown): id is Platform {
  return typeof id === "object" && id !== null && "properties" in id;
}
