//! One way to ask the server: an address in, the answer or an `ApiError` with the server's own reason out.
import type { Refusal } from "./types";

/** `refused`: the server answered and said no; `unreachable`: it did not answer at all. */
export class ApiError extends Error {
  constructor(
    readonly kind: "refused" | "unreachable",
    readonly status: number,
    message: string,
    /** When a refused question may be asked again, as the header of that name says it. */
    readonly retryAfter?: string,
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
  if (!response.ok) throw await refusalOf(response);
  return (await response.json()) as T;
}

/**
 * A picture; it may take as long as the server gives it.
 * @param onPart the share that has come, once the server has begun to send
 */
export async function getPicture(url: string, signal: AbortSignal, onPart?: (share: number) => void): Promise<Blob> {
  let response: Response;
  try {
    response = await fetch(url, { signal });
  } catch (error) {
    if (signal.aborted) throw error;
    throw new ApiError("unreachable", 0, "The server does not answer.");
  }
  if (!response.ok) throw await refusalOf(response);
  const bytes = Number(response.headers.get("content-length") ?? 0);
  if (!onPart || !response.body || bytes === 0) return response.blob();
  const parts: Uint8Array<ArrayBuffer>[] = [];
  let come = 0;
  for (const reader = response.body.getReader(); ; ) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    come += value.length;
    onPart(come / bytes);
  }
  return new Blob(parts, { type: response.headers.get("content-type") ?? "" });
}

async function refusalOf(response: Response): Promise<ApiError> {
  const retryAfter = response.headers.get("retry-after") ?? undefined;
  return new ApiError("refused", response.status, await reasonOf(response), retryAfter);
}

/** Why an answer is none, in the server's words if it has any. */
export async function reasonOf(response: Response): Promise<string> {
  const text = await response.text().catch(() => "");
  try {
    const body = JSON.parse(text) as Partial<Refusal>;
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
