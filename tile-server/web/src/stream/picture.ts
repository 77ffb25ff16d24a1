//! Messages of the stream: bytes or text in, a picture or an error out; undefined for what a newer server may send besides.

export type Kind = "moving" | "full";

export interface Picture {
  readonly id: number;
  readonly kind: Kind;
  readonly format: string;
  readonly width: number;
  readonly height: number;
  /** The address of what it shows. */
  readonly view: string;
  /** The instant that is shown where the one asked for lies outside of what there is, else nothing. */
  readonly timeIso: string;
  /** The server's share of the way, ms. */
  readonly tookMs: number;
  readonly bytes: Uint8Array<ArrayBuffer>;
}

export interface Refused {
  readonly id: number;
  readonly error: string;
  readonly status: number;
}

const LENGTH_BYTES = 4;

/** Four bytes with the length of the header (big-endian), the header (JSON), the picture. */
export function parsePicture(message: ArrayBuffer): Picture | undefined {
  if (message.byteLength < LENGTH_BYTES) return undefined;
  const end = LENGTH_BYTES + new DataView(message).getUint32(0);
  if (end >= message.byteLength) return undefined;
  const header = objectOf(new TextDecoder().decode(new Uint8Array(message, LENGTH_BYTES, end - LENGTH_BYTES)));
  const { id, kind, format, width, height, view, time, took_ms } = header ?? {};
  if (!isCount(id) || !isCount(width) || !isCount(height) || typeof format !== "string") return undefined;
  if (kind !== "moving" && kind !== "full") return undefined;
  return {
    id,
    kind,
    format,
    width,
    height,
    view: String(view ?? ""),
    timeIso: String(time ?? ""),
    tookMs: Number(took_ms ?? Number.NaN),
    bytes: new Uint8Array(message, end),
  };
}

export function parseRefused(text: string): Refused | undefined {
  const { id, error, status } = objectOf(text) ?? {};
  if (!isCount(id) || typeof error !== "string") return undefined;
  return { id, error, status: Number(status ?? 0) };
}

/** The pixels; decoding is done beside the page's own work. */
export function decode({ bytes, format }: Picture): Promise<ImageBitmap> {
  return createImageBitmap(new Blob([bytes], { type: format }));
}

function isCount(value: unknown): value is number {
  return typeof value === "number" && Number.isInteger(value) && value >= 0;
}

function objectOf(text: string): Record<string, unknown> | undefined {
  try {
    const value: unknown = JSON.parse(text);
    return typeof value === "object" && value !== null ? (value as Record<string, unknown>) : undefined;
  } catch {
    return undefined;
  }
}
