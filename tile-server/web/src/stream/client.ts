//! The stream's WebSocket: states as often as they change in, pictures in their order out; it finds its own way back after a break.
import { parsePicture, parseRefused, type Picture, type Refused } from "./picture";

/** The part of `WebSocket` that is used here. */
export interface Socket {
  binaryType: string;
  onopen: ((event: never) => void) | null;
  onmessage: ((event: never) => void) | null;
  onclose: ((event: never) => void) | null;
  send(text: string): void;
  close(): void;
}

/** What is told of a picture besides itself. */
export interface Shot<Scene, Image> {
  readonly picture: Picture;
  readonly image: Image;
  /** What it was asked for with, and when. */
  readonly scene: Scene;
  readonly askedMs: number;
}

export interface Hearer<Scene, Image> {
  onShot: (shot: Shot<Scene, Image>) => void;
  onRefused: (refused: Refused) => void;
  /** The stream opened, ended, or could not be opened. */
  onTurn: (isOpen: boolean) => void;
}

export interface Means<Image> {
  open: () => Socket;
  decode: (picture: Picture) => Promise<Image>;
  /** Nobody will see an image. */
  drop: (image: Image) => void;
  /** Calls once before the screen is drawn next. */
  frame: (call: () => void) => void;
  nowMs: () => number;
}

/** A server that had a stream is back soon; one that has none is asked seldom, because browsers write down every refusal. */
const AGAIN_MS = { broken: 500, absent: 30_000 };
const MOST_PAUSE_MS = { broken: 20_000, absent: 600_000 };

export class StreamClient<Scene, Image> {
  readonly #means: Means<Image>;
  readonly #hearer: Hearer<Scene, Image>;
  #socket: Socket | undefined;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isOpen = false;
  #failed = 0;
  #wanted: { scene: Scene; address: string } | undefined;
  #sent: string | undefined;
  #hasSentInFrame = false;
  #id = 0;
  /** States whose last picture is still to come, by their id. */
  readonly #asked = new Map<number, { scene: Scene; askedMs: number }>();
  #last: { id: number; isFull: boolean } = { id: 0, isFull: true };
  #given: { id: number; isFull: boolean } = this.#last;

  constructor(means: Means<Image>, hearer: Hearer<Scene, Image>) {
    this.#means = means;
    this.#hearer = hearer;
  }

  get isOpen(): boolean {
    return this.#isOpen;
  }

  /** Every state that was sent has its full picture. */
  get isAnswered(): boolean {
    return this.#given.id === this.#id && this.#given.isFull;
  }

  /** How long the oldest state that no picture has come for, nor for a newer one, is waited for. */
  get lagMs(): number {
    for (const [id, { askedMs }] of this.#asked) if (id > this.#given.id) return this.#means.nowMs() - askedMs;
    return 0;
  }

  start(): void {
    if (this.#socket || this.#timer !== undefined) return;
    this.#connect();
  }

  stop(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#failed = 0;
    const socket = this.#socket;
    this.#ended();
    socket?.close();
  }

  /** Asks for the picture of a scene; of those within one frame of the screen only the newest is sent, and none twice. */
  ask(scene: Scene, address: string): void {
    this.#wanted = { scene, address };
    if (!this.#hasSentInFrame) this.#send();
  }

  /** The same address has another picture now. */
  forget(): void {
    this.#sent = undefined;
  }

  /** The picture is on the screen. */
  seen(id: number): void {
    if (this.#isOpen) this.#socket?.send(JSON.stringify({ seen: id }));
  }

  #send(): void {
    const wanted = this.#wanted;
    if (!this.#isOpen || !wanted || wanted.address === this.#sent) return;
    this.#id += 1;
    this.#sent = wanted.address;
    this.#asked.set(this.#id, { scene: wanted.scene, askedMs: this.#means.nowMs() });
    this.#socket?.send(JSON.stringify({ id: this.#id, view: wanted.address }));
    this.#hasSentInFrame = true;
    this.#means.frame(() => {
      this.#hasSentInFrame = false;
      this.#send();
    });
  }

  #connect(): void {
    let socket: Socket;
    try {
      socket = this.#means.open();
    } catch {
      this.#again("absent");
      return;
    }
    this.#socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      if (socket !== this.#socket) return;
      this.#isOpen = true;
      this.#hearer.onTurn(true);
      this.#send();
    };
    socket.onmessage = ({ data }: { data: unknown }) => {
      if (socket === this.#socket) this.#hear(data);
    };
    socket.onclose = () => {
      if (socket !== this.#socket) return;
      const kind = this.#isOpen ? "broken" : this.#last.id > 0 ? "broken" : "absent";
      this.#ended();
      this.#again(kind);
    };
  }

  #ended(): void {
    const wasOpen = this.#isOpen;
    this.#socket = undefined;
    this.#isOpen = false;
    this.#sent = undefined;
    this.#asked.clear();
    if (wasOpen) this.#hearer.onTurn(false);
  }

  #again(kind: keyof typeof AGAIN_MS): void {
    const pauseMs = Math.min(AGAIN_MS[kind] * 2 ** this.#failed, MOST_PAUSE_MS[kind]);
    this.#failed += 1;
    if (kind === "absent") this.#hearer.onTurn(false);
    // Not all pages at once after a restart of the server.
    const jitter = 0.75 + Math.random() / 2;
    this.#timer = setTimeout(() => {
      this.#timer = undefined;
      this.#connect();
    }, pauseMs * jitter);
  }

  #hear(data: unknown): void {
    if (typeof data === "string") {
      const refused = parseRefused(data);
      // A newer state is under way.
      if (refused?.id === this.#id) this.#hearer.onRefused(refused);
      return;
    }
    const picture = data instanceof ArrayBuffer ? parsePicture(data) : undefined;
    const asked = picture && this.#asked.get(picture.id);
    if (!asked || !this.#isNewer(picture, this.#last)) return;
    this.#failed = 0;
    this.#last = { id: picture.id, isFull: picture.kind === "full" };
    for (const id of this.#asked.keys()) if (id < picture.id) this.#asked.delete(id);
    this.#means.decode(picture).then(
      (image) => {
        // Small pictures are decoded sooner than large ones that came before.
        if (!this.#isNewer(picture, this.#given) || !this.#isOpen) {
          this.#means.drop(image);
          return;
        }
        this.#given = { id: picture.id, isFull: picture.kind === "full" };
        this.#hearer.onShot({ picture, image, ...asked });
      },
      (error: unknown) => this.#hearer.onRefused({ id: picture.id, error: String(error), status: 0 }),
    );
  }

  /** A state has at most two pictures: one while the camera moves and the full one. */
  #isNewer({ id, kind }: Picture, than: { id: number; isFull: boolean }): boolean {
    return id > than.id || (id === than.id && kind === "full" && !than.isFull);
  }
}
