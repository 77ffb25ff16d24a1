//! How finely the globe is drawn: `?quality=low` for machines that draw with the processor, `high` for large screens.
import type { GlobeOptions } from "./globe";

const QUALITIES: Record<string, GlobeOptions> = {
  low: { screenSpaceError: 4, resolutionScale: 0.75, hasSky: false },
  normal: { screenSpaceError: 2.5, resolutionScale: 1, hasSky: true },
  high: { screenSpaceError: 1.5, resolutionScale: Math.min(2, window.devicePixelRatio), hasSky: true },
};

export function globeOptions(): GlobeOptions {
  const asked = new URLSearchParams(location.search).get("quality") ?? "normal";
  return QUALITIES[asked] ?? (QUALITIES["normal"] as GlobeOptions);
}
