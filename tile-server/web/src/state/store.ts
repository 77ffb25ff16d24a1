//! What the page shows, in one place: a small store that parts read, change and listen to.
import type { Mode } from "../api/types";
import { type Look, USUAL } from "../look/look";
import { type CameraView, HOME, type Place } from "./camera";

export type Tab = "place" | "budget" | "check" | "look" | "platform";
/** Those that a shared address can open; which platform was chosen is no part of it. */
export const TABS: readonly Tab[] = ["place", "budget", "check", "look"];

export interface State {
  product: string | null;
  mode: Mode;
  /** The instant asked for; NaN until a product is known. */
  timeMs: number;
  playing: boolean;
  /** Playback pace in product steps per second. */
  stepsPerSecond: number;
  opacity: number;
  /** Colours and surroundings of the layer. */
  look: Look;
  place: Place | null;
  /** Open analysis tab; null when the panel is closed. */
  tab: Tab | null;
  /** Region of the budget: `global`, a name, or `W,S,E,N`. */
  region: string;
  /** Buoys, ships, stations and casts are shown. */
  observations: boolean;
  /** Pictures that follow the camera lie over the globe, where the server has them. */
  live: boolean;
  camera: CameraView;
}

export const INITIAL: State = {
  product: null,
  mode: "map",
  timeMs: Number.NaN,
  playing: false,
  stepsPerSecond: 1,
  opacity: 0.9,
  look: USUAL,
  place: null,
  tab: null,
  region: "global",
  observations: false,
  live: true,
  camera: HOME,
};

type Listener = (state: Readonly<State>, before: Readonly<State>) => void;

export class Store {
  #state: State;
  readonly #listeners: Listener[] = [];

  constructor(initial: State) {
    this.#state = initial;
  }

  get state(): Readonly<State> {
    return this.#state;
  }

  set(change: Partial<State>): void {
    const before = this.#state;
    const keys = Object.keys(change) as (keyof State)[];
    if (keys.every((key) => Object.is(before[key], change[key]))) return;
    this.#state = { ...before, ...change };
    for (const listener of this.#listeners) listener(this.#state, before);
  }

  /** Calls `listener` after a change of any of `keys`. */
  on(keys: readonly (keyof State)[], listener: Listener): void {
    this.#listeners.push((state, before) => {
      if (keys.some((key) => !Object.is(state[key], before[key]))) listener(state, before);
    });
  }
}
