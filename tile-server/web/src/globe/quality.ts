//! How finely the globe is drawn: as `?quality=low|normal|high` says, else by whether a graphics chip or the processor draws.
import type { GlobeOptions } from "./globe";

type Quality = "low" | "normal" | "high";

const OPTIONS: Record<Quality, GlobeOptions> = {
  low: { screenSpaceError: 4, resolutionScale: 0.75, hasSky: false },
  normal: { screenSpaceError: 2.5, resolutionScale: 1, hasSky: true },
  high: { screenSpaceError: 1.5, resolutionScale: Math.min(2, window.devicePixelRatio), hasSky: true },
};

/** What software renderers call themselves. */
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

export function chooseQuality(): GlobeOptions {
  const asked = new URLSearchParams(location.search).get("quality");
  const quality = isQuality(asked) ? asked : isDrawnBySoftware() ? "low" : "normal";
  // The style sheet leaves out what costs most where the processor composes the page as well.
  document.body.dataset["quality"] = quality;
  return OPTIONS[quality];
}

function isQuality(text: string | null): text is Quality {
  return text !== null && Object.hasOwn(OPTIONS, text);
}

function isDrawnBySoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return true;
  const info = context.getExtension("WEBGL_debug_renderer_info");
  const name: unknown = context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return typeof name === "string" && SOFTWARE.test(name);
}
