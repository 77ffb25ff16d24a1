//! Watches for a server that went away: a failed request starts it, the health address ends it, and the page then asks again.
import type { TileFailure } from "../api/again";
import { ApiError, getJson } from "../api/client";
import { healthUrl } from "../api/requests";
import type { Notices } from "./notices";

const RETRY_MS = 3_000;
const KEY = "connection";

export class Connection {
  #isLost = false;
  readonly #notices: Notices;
  readonly #onTrouble: () => void;
  readonly #onBack: () => void;

  /** `onTrouble`: pictures fail to come, so that playing on would only repeat it. `onBack`: a lost server answers again. */
  constructor(notices: Notices, onTrouble: () => void, onBack: () => void) {
    this.#notices = notices;
    this.#onTrouble = onTrouble;
    this.#onBack = onBack;
  }

  /** Reports a failure under `key` in the server's own words, or as a lost connection when there were none. */
  report(key: string, error: unknown): void {
    if (error instanceof DOMException && error.name === "AbortError") return;
    if (error instanceof ApiError && error.kind === "unreachable") this.#lost();
    else this.#notices.show(key, error instanceof Error ? error.message : String(error));
  }

  /** The server does not say where a layer's pictures are. */
  layerRefused(error: unknown): void {
    this.#onTrouble();
    this.report("layer", error);
  }

  /** A tile failed: ask its address once more as JSON, unless that was said already or it is not time to ask. */
  async tileFailed({ status, url, reason }: TileFailure): Promise<void> {
    if (this.#isLost) return;
    if (status === undefined || status === 0) {
      this.#lost();
      return;
    }
    if (reason) {
      this.#onTrouble();
      this.report("tiles", new Error(`Pictures are missing: ${await reason}`));
      return;
    }
    try {
      await getJson<unknown>(url);
    } catch (error) {
      // A picture that arrives the second time is no JSON; that is the one failure which means that all is well.
      if (error instanceof SyntaxError) return;
      this.#onTrouble();
      const isRefused = error instanceof ApiError && error.kind === "refused";
      this.report("tiles", isRefused ? new Error(`Pictures are missing: ${error.message}`) : error);
    }
  }

  #lost(): void {
    if (this.#isLost) return;
    this.#isLost = true;
    this.#onTrouble();
    this.#notices.show(KEY, "The server does not answer. What is drawn stays; the page asks again every few seconds.");
    const timer = setInterval(() => {
      void fetch(healthUrl(), { cache: "no-store" }).then(
        (answer) => {
          if (!answer.ok || !this.#isLost) return;
          clearInterval(timer);
          this.#isLost = false;
          this.#notices.clear(KEY);
          this.#onBack();
        },
        () => undefined,
      );
    }, RETRY_MS);
  }
}
