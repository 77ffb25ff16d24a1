//! Pictures that come one by one in, a WebM film out; nothing of the page is known here. The one room that knows the film library.
import {
  BufferTarget,
  CanvasSource,
  getFirstEncodableVideoCodec,
  Output,
  QUALITY_HIGH,
  type VideoCodec,
  WebMOutputFormat,
} from "mediabunny";

/** Those that WebM holds, the one that is read most widely and still small first. */
const CODECS: VideoCodec[] = ["vp9", "av1", "vp8"];
/** What is seen beside the globe, where pictures are transparent: that of the page. */
const GROUND = "#02070c";

export interface FilmSize {
  readonly width: number;
  readonly height: number;
  readonly framesPerSecond: number;
}

/**
 * @param count pictures that are asked for
 * @param picture the picture of a number from 0
 * @param onFrame how many are in the film
 */
export async function makeFilm(
  { width, height, framesPerSecond }: FilmSize,
  count: number,
  picture: (index: number) => Promise<Blob>,
  onFrame: (done: number) => void,
  signal: AbortSignal,
): Promise<Blob> {
  const codec = await codecFor(width, height);
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d", { alpha: false });
  if (!context) throw new Error("This browser cannot draw the film's frames.");
  const target = new BufferTarget();
  const output = new Output({ format: new WebMOutputFormat(), target });
  const source = new CanvasSource(canvas, { codec, quality: QUALITY_HIGH });
  output.addVideoTrack(source, { frameRate: framesPerSecond });
  try {
    await output.start();
    for (let i = 0; i < count; i += 1) {
      const bitmap = await createImageBitmap(await picture(i));
      signal.throwIfAborted();
      context.fillStyle = GROUND;
      context.fillRect(0, 0, width, height);
      context.drawImage(bitmap, 0, 0, width, height);
      bitmap.close();
      await source.add(i / framesPerSecond, 1 / framesPerSecond);
      signal.throwIfAborted();
      onFrame(i + 1);
    }
    await output.finalize();
  } catch (error) {
    // What the encoder holds is let go; why it ended is told by the error itself.
    await output.cancel().catch(() => undefined);
    throw error;
  }
  if (!target.buffer) throw new Error("The browser's encoder gave no film.");
  return new Blob([target.buffer], { type: "video/webm" });
}

async function codecFor(width: number, height: number): Promise<VideoCodec> {
  const where = "Chrome, Edge, Firefox and Safari of the last years can, on pages over https or of this machine.";
  if (typeof VideoEncoder === "undefined") throw new Error(`This browser cannot encode films (no WebCodecs). ${where}`);
  const codec = await getFirstEncodableVideoCodec(CODECS, { width, height });
  if (!codec) throw new Error(`This browser cannot encode films of ${width} × ${height} pixels; choose a smaller size.`);
  return codec;
}
