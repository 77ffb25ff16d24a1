//! Observations: which platforms there are and what one of them measured.
import { address, getJson } from "./client";
import type { Answer, Observation, ObservationPage, Platform, QueryTexts } from "./types";
import { KINDS } from "./words";

/** Answers of one series; a plot of more values than these hold would not show more. */
const MOST_PAGES = 5;

export const platforms = (signal: AbortSignal) =>
  getJson<Answer<"platforms">>(address("api/observations/platforms"), signal);

export function seriesUrl(dataset: string, platform: string, query: QueryTexts<"observations"> = {}): string {
  return address(`api/observations/${encodeURIComponent(dataset)}/${encodeURIComponent(platform)}`, { ...query });
}

/** All pages of a series, or the first ones where there are very many; `next` is then where to go on. */
export async function series(dataset: string, platform: string, signal: AbortSignal): Promise<ObservationPage> {
  const all: Observation[] = [];
  let after: string | null = null;
  for (let page = 0; page < MOST_PAGES; page++) {
    const url = seriesUrl(dataset, platform, after === null ? {} : { after });
    const answer: ObservationPage = await getJson<Answer<"observations">>(url, signal);
    all.push(...answer.observations);
    after = answer.next;
    if (after === null) break;
  }
  return { observations: all, next: after };
}

/** `3 buoys, 1 ship`; the kinds that are there, in their order. */
export function countText(found: readonly Platform[]): string {
  const parts = KINDS.map((kind) => {
    const count = found.filter((platform) => platform.properties.kind === kind).length;
    return count === 0 ? "" : `${count} ${kind}${count === 1 ? "" : "s"}`;
  });
  return parts.filter((part) => part !== "").join(", ") || "none here";
}
