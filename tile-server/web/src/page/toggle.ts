//! A labelled check box: on or off in, on or off out.
import { el } from "./dom";

export function toggle(
  id: string,
  label: string,
  onChange: (isOn: boolean) => void,
): { element: HTMLElement; show: (isOn: boolean) => void } {
  const input = el("input", { type: "checkbox", id });
  input.addEventListener("change", () => onChange(input.checked));
  const element = el("label", { class: "toggle" }, input, el("span", {}, label));
  return {
    element,
    show: (isOn) => {
      input.checked = isOn;
    },
  };
}
