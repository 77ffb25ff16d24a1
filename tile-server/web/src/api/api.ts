//! The server's JSON, typed, and one way to ask for it: a request in, the answer or an `ApiError` with the server's own reason out.
import type { Bounds } from "../globe/box";
import { queryOf, type Parameter } from "../look/address";
import type { Mode } from "../state/store";

export interface Legend {
  low: number;
  high: number;
  unit: string;
  label: string;
  /** Position 0..1 between low and high, and a colour. */
  stops: [number, string][];
  /** Round values to mark; an older server does not say. */
  ticks?: number[];
}

export interface Palette {
  name: string;
  /** Position 0..1 and a colour, as in legends. */
  stops: [number, string][];
}

export interface Product {
  id: string;
  title: string;
  quantity: string;
  unit: string;
  display_unit: string;
  synthetic: boolean;
  source: string;
  manifest: string;
  /** The version it was computed from. */
  derived_from: string | null;
  bounds: [number, number, number, number];
  steps: { start: string; end: string; mid: string }[];
  modes: Mode[];
  legend: Legend;
  /** Speeds, where the mode flow is offered. */
  flow_legend?: Legend;
}

export interface PointSeries {
  product: string;
  manifest: string;
  unit: string;
  lon: number;
  lat: number;
  cell: { row: number; col: number; lon: number; lat: number };
  series: { start: string; end: string; mid: string; value: number | null }[];
}

export interface BudgetRow {
  start: string;
  end: string;
  budget: number;
  /** Of the sea. */
  coverage_percent: number;
  /** What counted: with whole cells also land on the coast. */
  area_m2: number;
  ocean_with_data_m2: number;
  /** What the sea without data would add: an estimate, no part of the budget. */
  gap: number | null;
  gap_area_m2: number;
}

export type Cells = "whole" | "ocean-share";

export interface Budget {
  product: string;
  manifest: string;
  region: string;
  earth: string;
  cells: Cells;
  unit: string;
  region_area_m2: number;
  ocean_area_m2: number;
  gap_basis: string;
  /** How the region was taken where that may surprise. */
  notes: string[];
  rows: BudgetRow[];
}

export interface BudgetQuery {
  /** `global`, a region's name, or `W,S,E,N`. */
  region: string;
  from: string;
  to: string;
  step: "month" | "year" | "total";
  earth: "wgs84" | "sphere";
  cells: Cells;
}

export interface Region {
  name: string;
  title: string;
  bounds: Bounds;
}

export interface CheckRow {
  what: string;
  period: string;
  unit: string;
  /** None where the paper prints no such number. */
  paper: CheckPaper | null;
  /** Of the same grid, by another program. */
  independent: number;
  ours: number;
  difference: number;
  agrees: boolean;
}

export interface CheckPaper {
  value: number;
  uncertainty: number | null;
  decimals: number;
  difference: number;
  verdict: "within" | "outside" | "no uncertainty stated";
}

export interface Check {
  rows: CheckRow[];
  note: string;
  method: string;
}

export interface LayerInfo {
  minzoom: number;
  maxzoom: number;
}

/** `refused`: the server answered and said no; `unreachable`: it did not answer at all. */
export class ApiError extends Error {
  constructor(
    readonly kind: "refused" | "unreachable",
    readonly status: number,
    message: string,
  ) {
    super(message);
    this.name = "ApiError";
  }
}

const ANSWER_LIMIT_MS = 60_000;

/** All addresses are relative to the page, so that the viewer also works below a path prefix. */
export function address(path: string, query: Record<string, string> = {}): string {
  const url = new URL(path, document.baseURI);
  for (const [key, value] of Object.entries(query)) url.searchParams.set(key, value);
  return url.href;
}

export async function getJson<T>(url: string, signal?: AbortSignal): Promise<T> {
  const limit = AbortSignal.timeout(ANSWER_LIMIT_MS);
  let response: Response;
  try {
    response = await fetch(url, {
      signal: signal ? anyOf(signal, limit) : limit,
      headers: { accept: "application/json" },
    });
  } catch (error) {
    if (signal?.aborted) throw error;
    const why = limit.aborted ? `no answer within ${ANSWER_LIMIT_MS / 1000} s` : "the connection failed";
    throw new ApiError("unreachable", 0, `The server does not answer (${why}).`);
  }
  if (!response.ok) throw new ApiError("refused", response.status, await reasonOf(response));
  return (await response.json()) as T;
}

export async function reasonOf(response: Response): Promise<string> {
  const text = await response.text().catch(() => "");
  try {
    const body = JSON.parse(text) as { error?: unknown };
    if (typeof body.error === "string" && body.error !== "") return body.error;
  } catch {
    // Not JSON: a proxy in between may answer with a page of its own, of which only the status is worth showing.
  }
  return `The server answered ${response.status} ${response.statusText}`.trim();
}

/** `AbortSignal.any` is younger than the browsers that still draw this page. */
function anyOf(a: AbortSignal, b: AbortSignal): AbortSignal {
  const both = new AbortController();
  for (const signal of [a, b]) {
    if (signal.aborted) both.abort(signal.reason);
    signal.addEventListener("abort", () => both.abort(signal.reason), { once: true });
  }
  return both.signal;
}

export const products = () => getJson<{ products: Product[] }>(address("api/products")).then((body) => body.products);
export const regions = () => getJson<{ regions: Region[] }>(address("api/regions")).then((body) => body.regions);
export const palettes = () => getJson<{ palettes: Palette[] }>(address("api/palettes")).then((body) => body.palettes);
export const layerInfo = (product: string, mode: Mode) =>
  getJson<LayerInfo>(address(`tiles/${encodeURIComponent(product)}/${mode}.json`));
export const healthUrl = () => address("healthz");

/** What the colours of a look mean; `colours` are the parameters of it that a legend goes by. Only a flow's are of another value. */
export function legend(product: string, mode: Mode, colours: readonly Parameter[]): Promise<Legend> {
  const query = { ...(mode === "flow" ? { mode } : {}), ...Object.fromEntries(colours) };
  return getJson<Legend>(address(`api/products/${encodeURIComponent(product)}/legend.json`, query));
}

/** Undefined where the server has no published values to hold against. */
export async function check(): Promise<Check | undefined> {
  const answer = await getJson<Check | null>(address("api/check"));
  return answer !== null && answer.rows.length > 0 ? answer : undefined;
}

export function point(product: string, lon: number, lat: number, signal: AbortSignal): Promise<PointSeries> {
  return getJson<PointSeries>(pointUrl(product, lon, lat), signal);
}

export function pointUrl(product: string, lon: number, lat: number): string {
  return address(`api/products/${encodeURIComponent(product)}/point`, { lon: lon.toFixed(4), lat: lat.toFixed(4) });
}

export function budget(product: string, query: BudgetQuery, signal: AbortSignal): Promise<Budget> {
  return getJson<Budget>(budgetUrl(product, query), signal);
}

export function budgetUrl(product: string, query: BudgetQuery): string {
  return address(`api/products/${encodeURIComponent(product)}/budget`, { ...query });
}

/** Which data is drawn. It is a part of a tile's address, so that no cache on the way answers with older pictures. */
export interface Version {
  readonly manifest: string;
  /** Rises when the same version looks different: what lifts its particles comes later than it. */
  readonly revision: number;
}

/** `{z}`, `{x}` and `{y}` are left for the imagery provider to fill. */
export function tileTemplate(
  product: string,
  mode: Mode,
  timeIso: string,
  version: Version,
  look: readonly Parameter[] = [],
): string {
  const folder = address(`tiles/${encodeURIComponent(product)}/${mode}/`);
  const query = queryOf([
    ["time", encodeURIComponent(timeIso)],
    ["manifest", encodeURIComponent(version.manifest)],
    ...(version.revision > 0 ? [["revision", String(version.revision)] as const] : []),
    ...look,
  ]);
  return `${folder}{z}/{x}/{y}.png?${query}`;
}

export interface GlobeView {
  lon: number;
  lat: number;
  heightKm: number;
  timeIso: string;
  width: number;
  height: number;
  look: readonly Parameter[];
}

export function globeUrl(product: string, mode: Mode, view: GlobeView): string {
  return address(`globe/${encodeURIComponent(product)}/${mode}.png`, {
    lon: view.lon.toFixed(4),
    lat: view.lat.toFixed(4),
    height_km: view.heightKm.toFixed(1),
    time: view.timeIso,
    width: String(view.width),
    height: String(view.height),
    ...Object.fromEntries(view.look),
  });
}
