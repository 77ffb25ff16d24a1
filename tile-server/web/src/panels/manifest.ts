//! The line that makes a number citable: the manifest a value was computed from, with a button that copies it.
import { el, icon } from "../page/dom";
import { COPY, TICK } from "../page/icons";

const COPIED_MS = 1_500;

export function manifestLine(manifest: string): HTMLElement {
  const button = el(
    "button",
    { type: "button", class: "quiet", "aria-label": "Copy the manifest id", title: "Copy" },
    icon(COPY),
  );
  button.addEventListener("click", () => {
    // Clipboards are refused to pages that are not served securely; the id can still be selected by hand.
    navigator.clipboard?.writeText(manifest).then(
      () => {
        button.replaceChildren(icon(TICK));
        setTimeout(() => button.replaceChildren(icon(COPY)), COPIED_MS);
      },
      () => undefined,
    );
  });
  return el("p", { class: "manifest" }, el("span", { class: "muted" }, "Manifest "), el("code", {}, manifest), button);
}
