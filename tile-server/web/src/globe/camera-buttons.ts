//! Buttons beside the globe: nearer, further, north up, and back to where the page began.
import { el, icon } from "../page/dom";
import { HOUSE, MINUS, NORTH, PLUS } from "../page/icons";
import type { Globe } from "./globe";

export class CameraButtons {
  constructor(container: HTMLElement, globe: Globe) {
    container.append(
      button("Zoom in", PLUS, () => globe.zoom(1)),
      button("Zoom out", MINUS, () => globe.zoom(-1)),
      button("North up", NORTH, () => globe.northUp()),
      button("Back to the start", HOUSE, () => globe.home()),
    );
  }
}

function button(label: string, path: string, act: () => void): HTMLElement {
  return el("button", { type: "button", class: "round", "aria-label": label, title: label, onclick: act }, icon(path));
}
