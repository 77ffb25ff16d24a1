//! What the page asks for as JSON, one function a question.
import { address, getJson } from "./client";
import type { Parameter } from "./pictures";
import type { Answer, Budget, BudgetQuery, Check, Legend, Mode, PointSeries, QueryTexts, RegionMeans, TileJson } from "./types";

export const products = () => getJson<Answer<"products">>(address("api/products")).then((body) => body.products);
export const regions = () => getJson<Answer<"regions">>(address("api/regions")).then((body) => body.regions);
export const palettes = () => getJson<Answer<"palettes">>(address("api/palettes")).then((body) => body.palettes);
export const healthUrl = () => address("healthz");

/** How the tiles of a version in a look are asked for. */
export function layerInfo(product: string, mode: Mode, manifest: string, look: readonly Parameter[]): Promise<TileJson> {
  const query: QueryTexts<"tilejson"> = { manifest, ...Object.fromEntries(look) };
  return getJson<TileJson>(address(`tiles/${encodeURIComponent(product)}/${mode}.json`, { ...query }));
}

/** What the colours of a look of a version mean; `colours` are the parameters of it that a legend goes by. Only a flow's are of another value. */
export function legend(product: string, mode: Mode, manifest: string, colours: readonly Parameter[]): Promise<Legend> {
  const query: QueryTexts<"legend"> = { manifest, ...(mode === "flow" ? { mode } : {}), ...Object.fromEntries(colours) };
  return getJson<Answer<"legend">>(address(`api/products/${encodeURIComponent(product)}/legend.json`, { ...query }));
}

/** Undefined where the server has no published values to hold against. */
export async function check(): Promise<Check | undefined> {
  const answer = await getJson<Answer<"check">>(address("api/check"));
  return answer !== null && answer.rows.length > 0 ? answer : undefined;
}

export function point(product: string, lon: number, lat: number, signal: AbortSignal): Promise<PointSeries> {
  return getJson<PointSeries>(pointUrl(product, lon, lat), signal);
}

export function pointUrl(product: string, lon: number, lat: number): string {
  const query = { lon: lon.toFixed(4), lat: lat.toFixed(4) } satisfies QueryTexts<"point">;
  return address(`api/products/${encodeURIComponent(product)}/point`, query);
}

/** Means by area over a budget's region and period, a row a step. */
export function area(product: string, query: BudgetQuery, signal: AbortSignal): Promise<RegionMeans> {
  return getJson<RegionMeans>(areaUrl(product, query), signal);
}

export function areaUrl(product: string, { region, from, to, earth }: BudgetQuery): string {
  const query = { region, from, to, earth } satisfies QueryTexts<"area">;
  return address(`api/products/${encodeURIComponent(product)}/area`, query);
}

export function budget(product: string, query: BudgetQuery, signal: AbortSignal): Promise<Budget> {
  return getJson<Answer<"budget">>(budgetUrl(product, query), signal);
}

export function budgetUrl(product: string, query: BudgetQuery): string {
  return address(`api/products/${encodeURIComponent(product)}/budget`, { ...query });
}
