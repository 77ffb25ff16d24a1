//! A picture taken by one camera, for another: two poses in, the plane transform that brings the ground of the one onto the other's out.
import { groundAlong, type Point, type Pose, seen, seenFar, sight } from "./pose";

/** Rows of a 3 x 3 matrix of homogeneous window pixels, the last number 1. */
export type Matrix = readonly number[];

export interface Warp {
  readonly matrix: Matrix;
  /** How far the ground is still off, root of the mean square, as a share of the window's shorter side. */
  readonly miss: number;
  /** Share of the window that the picture covers. */
  readonly cover: number;
}

/** Points of the window that are looked at, and how many of them the picture's camera must have had before it. */
const [ACROSS, DOWN] = [7, 5];
const LEAST_SHARE = 0.7;
/** Points on the very edge are within. */
const EDGE_PX = 0.5;

interface Pair {
  readonly from: Point;
  readonly to: Point;
}

/** Undefined where the picture's camera looked elsewhere. A turn alone is exact; a move is as good as the ground is flat. */
export function warp(picture: Pose, now: Pose): Warp | undefined {
  const pairs = pairsOf(picture, now);
  if (pairs.length < ACROSS * DOWN * LEAST_SHARE) return undefined;
  const matrix = fitted(pairs, Math.max(now.width, now.height));
  if (!matrix) return undefined;
  const squares = pairs.map(({ from, to }) => {
    const at = moved(matrix, from);
    return (at.x - to.x) ** 2 + (at.y - to.y) ** 2;
  });
  const miss = Math.sqrt(squares.reduce((sum, square) => sum + square, 0) / pairs.length);
  const isWithin = (at: number, side: number) => at >= -EDGE_PX && at <= side + EDGE_PX;
  const inside = pairs.filter(({ from: { x, y } }) => isWithin(x, picture.width) && isWithin(y, picture.height));
  return { matrix, miss: miss / Math.min(now.width, now.height), cover: inside.length / (ACROSS * DOWN) };
}

/** As style sheets write it. */
export function cssMatrix([a = 1, b = 0, c = 0, d = 0, e = 1, f = 0, g = 0, h = 0, i = 1]: Matrix): string {
  return `matrix3d(${[a, d, 0, g, b, e, 0, h, 0, 0, 1, 0, c, f, 0, i].map((number) => Number(number.toPrecision(9))).join(",")})`;
}

export function moved([a = 1, b = 0, c = 0, d = 0, e = 1, f = 0, g = 0, h = 0, i = 1]: Matrix, { x, y }: Point): Point {
  const w = g * x + h * y + i;
  return { x: (a * x + b * y + c) / w, y: (d * x + e * y + f) / w };
}

function pairsOf(picture: Pose, now: Pose): Pair[] {
  const pairs: Pair[] = [];
  for (let row = 0; row < DOWN; row++) {
    for (let column = 0; column < ACROSS; column++) {
      const to = { x: (now.width * column) / (ACROSS - 1), y: (now.height * row) / (DOWN - 1) };
      const line = sight(now, to);
      const ground = groundAlong(now, line);
      const from = ground ? seen(picture, ground) : seenFar(picture, line);
      if (from) pairs.push({ from, to });
    }
  }
  return pairs;
}

/** Least squares of `to * w - (row of the matrix) * from`, with the window scaled to about 1 so that sums keep their digits. */
function fitted(pairs: readonly Pair[], scale: number): Matrix | undefined {
  const sums = Array.from({ length: 8 }, () => new Array<number>(9).fill(0));
  for (const { from, to } of pairs) {
    const [x, y, u, v] = [from.x / scale, from.y / scale, to.x / scale, to.y / scale];
    for (const row of [
      [x, y, 1, 0, 0, 0, -u * x, -u * y, u],
      [0, 0, 0, x, y, 1, -v * x, -v * y, v],
    ]) {
      sums.forEach((line, i) => line.forEach((_, j) => (line[j] = (line[j] ?? 0) + (row[i] ?? 0) * (row[j] ?? 0))));
    }
  }
  const solved = solve(sums);
  if (!solved) return undefined;
  const [a = 0, b = 0, c = 0, d = 0, e = 0, f = 0, g = 0, h = 0] = solved;
  return [a, b, c * scale, d, e, f * scale, g / scale, h / scale, 1];
}

/** Gauss' elimination; the last column is the right side. Undefined for what has no one answer. */
function solve(lines: number[][]): number[] | undefined {
  const size = lines.length;
  for (let pivot = 0; pivot < size; pivot++) {
    const at = (line: number[] | undefined) => Math.abs(line?.[pivot] ?? 0);
    const best = lines.reduce((found, line, i) => (i > pivot && at(line) > at(lines[found]) ? i : found), pivot);
    const [top, other] = [lines[best], lines[pivot]];
    if (!top || !other || at(top) < 1e-12) return undefined;
    [lines[best], lines[pivot]] = [other, top];
    for (const line of lines) {
      if (line === top) continue;
      const part = (line[pivot] ?? 0) / (top[pivot] ?? 1);
      top.forEach((number, j) => (line[j] = (line[j] ?? 0) - part * number));
    }
  }
  return lines.map((line, i) => (line[size] ?? 0) / (line[i] ?? 1));
}
