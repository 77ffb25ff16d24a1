//! News of new data: the server's event stream in, what became new in small bundles out; it finds its own way back after a break,
//! and says so, because what was told meanwhile may be lost.
import { address } from "./client";
import type { News } from "./types";

/** What landed together is told together: one reload instead of one for each. */
const GATHER_MS = 300;
/** The browser comes back by itself after a break, but not after a refusal. */
const REOPEN_MS = 15_000;
const CLOSED = 2;

/** The part of `EventSource` that is used here. */
export interface Stream {
  readonly readyState: number;
  addEventListener(type: string, listener: (event: MessageEvent<string>) => void): void;
  close(): void;
}

/** `isAnew`: the stream has just been opened, and what was told before nobody may have heard. */
type OnNews = (news: News[], isAnew: boolean) => void;

export class Updates {
  readonly #onNews: OnNews;
  readonly #open: (url: string) => Stream;
  #gathered: News[] = [];
  #isAnew = false;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(onNews: OnNews, open: (url: string) => Stream = (url) => new EventSource(url)) {
    this.#onNews = onNews;
    this.#open = open;
    this.#listen();
  }

  #listen(): void {
    const stream = this.#open(address("api/events"));
    stream.addEventListener("open", () => {
      this.#isAnew = true;
      this.#gather();
    });
    stream.addEventListener("product", (event) => {
      const news = parseNews(event.data);
      if (news) this.#gather(news);
    });
    stream.addEventListener("error", () => {
      if (stream.readyState !== CLOSED) return;
      stream.close();
      setTimeout(() => this.#listen(), REOPEN_MS);
    });
  }

  #gather(...news: News[]): void {
    this.#gathered.push(...news);
    this.#timer ??= setTimeout(() => {
      this.#timer = undefined;
      const isAnew = this.#isAnew;
      this.#isAnew = false;
      this.#onNews(this.#gathered.splice(0), isAnew);
    }, GATHER_MS);
  }
}

/** Undefined for what is no news, for example from a newer server. */
export function parseNews(text: string): News | undefined {
  let body: Partial<News> | null;
  try {
    body = JSON.parse(text) as Partial<News> | null;
  } catch {
    return undefined;
  }
  if (!body || typeof body.product !== "string" || typeof body.manifest !== "string") return undefined;
  const touched = Array.isArray(body.touched) ? body.touched : [];
  return { product: body.product, manifest: body.manifest, touched };
}

/** Does the picture at an instant change? */
export function touches(news: News, timeMs: number): boolean {
  return news.touched.some((period) => Date.parse(period.start) <= timeMs && timeMs <= Date.parse(period.end));
}
