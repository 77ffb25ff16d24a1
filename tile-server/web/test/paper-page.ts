//! A page of paper: elements that hold attributes, values, texts and listeners, for what is built without a browser.

export class PaperElement {
  readonly style: Record<string, string> = {};
  value = "";
  hidden = false;
  disabled = false;
  textContent: string | null = "";
  readonly attributes = new Map<string, string>();
  readonly #listeners = new Map<string, ((event: unknown) => void)[]>();
  children: (PaperElement | string)[] = [];

  setAttribute(name: string, value: string): void {
    this.attributes.set(name, value);
    if (name === "value") this.value = value;
    if (name === "hidden") this.hidden = true;
  }

  append(...children: (PaperElement | string)[]): void {
    this.children.push(...children);
  }

  replaceChildren(...children: (PaperElement | string)[]): void {
    this.children = children;
  }

  addEventListener(type: string, listener: (event: unknown) => void): void {
    this.#listeners.set(type, [...(this.#listeners.get(type) ?? []), listener]);
  }

  /** What somebody does to the element. */
  tell(type: string): void {
    for (const listener of this.#listeners.get(type) ?? []) listener({ preventDefault: () => undefined });
  }

  get text(): string {
    return this.children.map((child) => (typeof child === "string" ? child : child.text)).join(" ");
  }

  /** Itself or the one below it with an id. */
  find(id: string): PaperElement | undefined {
    if (this.attributes.get("id") === id) return this;
    for (const child of this.children) {
      const found = typeof child === "string" ? undefined : child.find(id);
      if (found) return found;
    }
    return undefined;
  }
}

/** What stands for `document`. */
export function paperDocument(): Record<string, unknown> {
  const made = () => new PaperElement();
  return { baseURI: "http://host/", createElement: made, createElementNS: made };
}
