//! What the stream is asked for: the state of the page in, the address of the picture of it out, the same as of "Render this view".
import { globePath, type GlobeView, MOST_SCREEN_PX, within } from "../api/pictures";
import type { Mode } from "../api/types";
import type { LayerSpec } from "../globe/layer";
import { viewParameters } from "../look/address";
import { type CameraView, OPENING_DEG } from "../state/camera";

/** Those whose particles stand above the ground: a map lies on it, and tiles show all of it. */
const RAISED: readonly Mode[] = ["points", "sprites", "volume", "flow"];

export function isRaised(mode: Mode): boolean {
  return RAISED.includes(mode);
}

/** All that a picture depends on. */
export interface Scene {
  readonly spec: LayerSpec;
  readonly camera: CameraView;
  /** Of the window, in its own pixels. */
  readonly width: number;
  readonly height: number;
  /** The screen's pixels in one of the window's. */
  readonly density: number;
}

export function viewOf(spec: LayerSpec, camera: CameraView, size: { width: number; height: number }): GlobeView {
  const { timeIso, manifest, look } = spec;
  return { ...camera, ...size, openingDeg: OPENING_DEG, timeIso, manifest, look: viewParameters(look) };
}

/** From the server's own root, whatever path the page is found under. */
export function viewAddress({ spec, camera, width, height, density }: Scene): string {
  const size = within(MOST_SCREEN_PX, width * density, height * density);
  return `/${globePath(spec.product, spec.mode, viewOf(spec, camera, size))}`;
}

/** Two scenes of which one's picture may stand for the other's while that is on its way. */
export function isAlike(a: LayerSpec, b: LayerSpec): boolean {
  return a.product === b.product && a.mode === b.mode;
}

export function isSameCamera(a: Scene, b: Scene): boolean {
  const [one, other] = [a.camera, b.camera];
  return (
    a.width === b.width && a.height === b.height && (Object.keys(one) as (keyof CameraView)[]).every((key) => one[key] === other[key])
  );
}
