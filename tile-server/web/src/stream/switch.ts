//! The toggle of the live picture on the layer card, and one word on whether this server has it.
import { el } from "../page/dom";
import { toggle } from "../page/toggle";
import type { Store } from "../state/store";
import type { Live } from "./live";
import { isRaised } from "./view";

export class LiveSwitch {
  constructor(container: HTMLElement, store: Store, live: Live) {
    const box = toggle("live", "Live picture", (isOn) => store.set({ live: isOn }));
    const word = el("span", { class: "muted", id: "live-status", role: "status" });
    box.element.append(word);
    box.element.title = "The server draws what you look at while you move. Press f to see how fast.";
    container.append(box.element);
    const draw = (isCarried: boolean): void => {
      const { live: isOn, mode } = store.state;
      box.show(isOn);
      container.hidden = !isRaised(mode);
      word.textContent = isOn && live.isAbsent ? "not available right now" : "";
      // The picture has a ground of its own: there is nothing for it to be seen through.
      document.body.classList.toggle("is-live", isCarried);
    };
    live.onTurn = draw;
    draw(false);
  }
}
