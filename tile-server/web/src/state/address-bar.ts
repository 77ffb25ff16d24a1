//! The address bar: the state in, its hash out after a pause; a hash that somebody types in, the change that it means out.
import { decodeHash, encodeHash } from "./hash";
import type { State, Store } from "./store";

/** Browsers refuse a page that rewrites its address too often. */
const PAUSE_MS = 300;

/** A hash that is typed or pasted into an open page is meant as a whole new view: `onTyped` gets all that it says. */
export function keepAddress(store: Store, onTyped: (change: Partial<State>) => void): void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  store.on(["product", "mode", "timeMs", "camera", "opacity", "look", "place", "tab", "region", "observations", "live"], () => {
    timer ??= setTimeout(() => {
      timer = undefined;
      history.replaceState(null, "", encodeHash(store.state));
    }, PAUSE_MS);
  });
  window.addEventListener("hashchange", () => onTyped(decodeHash(location.hash)));
}
