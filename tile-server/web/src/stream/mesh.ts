//! A picture taken by one camera, for another: two poses in, for each knot of a mesh over the window its place in the picture out.
import { groundAlong, nearestAlong, type Point, type Pose, seen, sight, type Vector } from "./pose";

/** Cells across and down: so small that the globe is flat within one. */
export const ACROSS = 40;
export const DOWN = 25;

export interface Mesh {
  /** Three numbers a knot, row by row from the upper left: shares of the picture's width and height, and 1 where its camera saw it. */
  readonly places: Float32Array;
  /** Share of the window that the picture covers. */
  readonly cover: number;
  /** How far the camera went, as a share of its distance from what it looks at: what stands up leans by about that much. */
  readonly lean: number;
}

export function meshOf(picture: Pose, now: Pose): Mesh {
  const places = new Float32Array(3 * (ACROSS + 1) * (DOWN + 1));
  let covered = 0;
  for (let row = 0, at = 0; row <= DOWN; row++) {
    for (let column = 0; column <= ACROSS; column++, at += 3) {
      const from = placeIn(picture, now, { x: (now.width * column) / ACROSS, y: (now.height * row) / DOWN });
      if (!from) continue;
      const [x, y] = [from.x / picture.width, from.y / picture.height];
      places.set([x, y, 1], at);
      if (x >= -EDGE && y >= -EDGE && x <= 1 + EDGE && y <= 1 + EDGE) covered += 1;
    }
  }
  const middle = { x: now.width / 2, y: now.height / 2 };
  const target = placeAlong(now, sight(now, middle));
  const lean = distance(picture.place, now.place) / distance(now.place, target);
  return { places, cover: covered / (places.length / 3), lean };
}

/** Points on the very edge are within. */
const EDGE = 1e-3;

/**
 * Where in the picture that is which a camera sees at a point of its window; undefined beside and behind the picture's camera.
 * What lay beyond its horizon is taken from before it: a strip without a picture would be seen, these few pixels are not.
 */
export function placeIn(picture: Pose, now: Pose, point: Point): Point | undefined {
  return seen(picture, placeAlong(now, sight(now, point)));
}

/** The ground, and beside the globe what is nearest to it: so nothing tears at the horizon. */
function placeAlong(pose: Pose, direction: Vector): Vector {
  return groundAlong(pose, direction) ?? nearestAlong(pose, direction);
}

function distance(a: Vector, b: Vector): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}
