//! Where a camera stands and what it sees: camera and window in, places on the window and sight lines out. The server's renderer reckons the same way.
import { type CameraView, OPENING_DEG, SPHERE_RADIUS_M } from "../state/camera";

/** Lengths in earth radii; x towards 90 E, y towards 0 E, z towards the north pole. */
export type Vector = readonly [x: number, y: number, z: number];

/** A point of the window, pixels from its upper left corner. */
export interface Point {
  readonly x: number;
  readonly y: number;
}

export interface Pose {
  readonly place: Vector;
  /** Towards the right and the upper edge of the window, and along the line of sight. */
  readonly right: Vector;
  readonly top: Vector;
  readonly forward: Vector;
  readonly focalPx: number;
  readonly width: number;
  readonly height: number;
}

/** What is beside the globe and nearest to a camera that looks away from it is taken to be this far ahead, earth radii. */
const LEAST_AHEAD = 0.2;
/** Nearer to the plane of the camera than this nothing is seen. */
const LEAST_DEPTH = 1e-6;
/** A sight line this little below the ground touches it. */
const GRAZING = 1e-9;

export function poseOf(camera: CameraView, width: number, height: number): Pose {
  const [east, north, up] = axesAt(camera.lon, camera.lat);
  const [sinHeading, cosHeading] = turn(camera.headingDeg);
  const [sinTilt, cosTilt] = turn(90 + camera.pitchDeg);
  const [sinRoll, cosRoll] = turn(camera.rollDeg);
  const ahead = sum(east, sinHeading, north, cosHeading);
  const level = sum(east, cosHeading, north, -sinHeading);
  const upright = sum(up, sinTilt, ahead, cosTilt);
  return {
    place: scaled(up, 1 + (camera.heightKm * 1000) / SPHERE_RADIUS_M),
    right: sum(level, cosRoll, upright, -sinRoll),
    top: sum(upright, cosRoll, level, sinRoll),
    forward: sum(ahead, sinTilt, up, -cosTilt),
    focalPx: Math.min(width, height) / 2 / Math.tan((OPENING_DEG * Math.PI) / 360),
    width,
    height,
  };
}

/** A place on the ground, or some metres above it. */
export function onGround(lon: number, lat: number, heightM = 0): Vector {
  return scaled(axesAt(lon, lat)[2], 1 + heightM / SPHERE_RADIUS_M);
}

/** Undefined for what lies beside or behind the camera. */
export function seen(pose: Pose, place: Vector): Point | undefined {
  return onWindow(pose, sum(place, 1, pose.place, -1));
}

/** The direction in which a point of the window is seen. */
export function sight(pose: Pose, { x, y }: Point): Vector {
  const [east, south] = [(x - pose.width / 2) / pose.focalPx, (y - pose.height / 2) / pose.focalPx];
  const line = sum(sum(pose.right, east, pose.top, -south), 1, pose.forward, 1);
  return scaled(line, 1 / Math.hypot(...line));
}

/** Where a sight line meets the ground; undefined in the sky. */
export function groundAlong({ place }: Pose, direction: Vector): Vector | undefined {
  const along = dot(place, direction);
  const below = along * along - dot(place, place) + 1;
  if (along >= 0 || below <= 0) return undefined;
  return sum(place, 1, direction, -along - Math.sqrt(below));
}

/** The place on a sight line beside the globe that is nearest to it, or some way ahead where that lies behind. */
export function nearestAlong({ place }: Pose, direction: Vector): Vector {
  return sum(place, 1, direction, Math.max(LEAST_AHEAD, -dot(place, direction)));
}

/** Does the globe hide a place on or above the ground? */
export function isHidden({ place: eye }: Pose, place: Vector): boolean {
  const line = sum(place, 1, eye, -1);
  const nearest = -dot(eye, line) / dot(line, line);
  if (nearest <= 0 || nearest >= 1) return false;
  const at = sum(eye, 1, line, nearest);
  return dot(at, at) < 1 - GRAZING;
}

function onWindow(pose: Pose, line: Vector): Point | undefined {
  const depth = dot(line, pose.forward);
  if (depth < LEAST_DEPTH) return undefined;
  const perDepth = pose.focalPx / depth;
  return { x: pose.width / 2 + dot(line, pose.right) * perDepth, y: pose.height / 2 - dot(line, pose.top) * perDepth };
}

/** East, north and up. */
function axesAt(lon: number, lat: number): [Vector, Vector, Vector] {
  const [sinLon, cosLon] = turn(lon);
  const [sinLat, cosLat] = turn(lat);
  return [
    [cosLon, -sinLon, 0],
    [-sinLat * sinLon, -sinLat * cosLon, cosLat],
    [cosLat * sinLon, cosLat * cosLon, sinLat],
  ];
}

function turn(degrees: number): [sine: number, cosine: number] {
  const radians = (degrees * Math.PI) / 180;
  return [Math.sin(radians), Math.cos(radians)];
}

function sum(a: Vector, timesA: number, b: Vector, timesB: number): Vector {
  return [a[0] * timesA + b[0] * timesB, a[1] * timesA + b[1] * timesB, a[2] * timesA + b[2] * timesB];
}

function scaled(a: Vector, times: number): Vector {
  return [a[0] * times, a[1] * times, a[2] * times];
}

function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
