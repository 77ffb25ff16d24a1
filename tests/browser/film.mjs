//! What a page shows while something happens: every picture that the browser puts on the screen in, what is read from its pixels out.

/** The ground of the example pages, red, green, blue. */
const GROUND = [0x7d, 0x85, 0x8c];
/** Part of the window that nothing else lies on: below the bar, above attribution and messages. */
const TOP_PX = 140;
const BOTTOM_PX = 90;

export class Film {
  #page;
  #session;
  #reader;
  #frames = [];

  static async of(page) {
    const film = new Film();
    film.#page = page;
    film.#session = await page.context().newCDPSession(page);
    film.#session.on("Page.screencastFrame", ({ data, metadata, sessionId }) => {
      film.#take({ data, time: metadata.timestamp });
      void film.#session.send("Page.screencastFrameAck", { sessionId });
    });
    // A page that decodes pictures.
    film.#reader = await page.context().newPage();
    await page.bringToFront();
    return film;
  }

  /** Two pictures are compressed at a time, and the later one may be told first. */
  #take(frame) {
    const later = this.#frames.findIndex(({ time }) => time > frame.time);
    this.#frames.splice(later < 0 ? this.#frames.length : later, 0, frame);
  }

  async start() {
    this.#frames = [];
    await this.#session.send("Page.startScreencast", { format: "png", everyNthFrame: 1 });
  }

  /** The share that is covered in every picture since the start. */
  async stop() {
    const shares = [];
    for (const frame of await this.end()) shares.push(await this.#coveredIn(frame));
    return shares;
  }

  /** The newest picture since the start. */
  get last() {
    return this.#frames.at(-1)?.data;
  }

  /** Every picture since the start, in the order of their time. */
  async end() {
    await this.#session.send("Page.stopScreencast");
    return this.#frames.map(({ data }) => data);
  }

  /** What `measure` makes of the pixels of each picture, given those of other ones as well; it runs in the browser. */
  async read(pictures, measure, others = []) {
    const all = [];
    for (const picture of pictures) {
      // The page that reads would complain of an address that is none.
      const [source, texts] = [measure.toString(), [picture, ...others]];
      if (!texts.every(Boolean)) throw new Error("there is no picture yet");
      all.push(await this.#reader.evaluate(readPictures, { source, texts }));
    }
    return all;
  }

  async close() {
    await this.#reader.close();
  }

  async picture() {
    return (await this.#page.screenshot()).toString("base64");
  }

  async covered() {
    return this.#coveredIn(await this.picture());
  }

  #coveredIn(png) {
    return this.#count([png], GROUND);
  }

  /** The share of the map that differs. */
  changed(before, after) {
    return this.#count([before, after]);
  }

  #count(pictures, ground) {
    return this.#reader.evaluate(
      async ([pictures, ground, top, bottom]) => {
        const all = await Promise.all(pictures.map(pixels));
        let [count, different] = [0, 0];
        for (let i = 0; i < all[0].length; i += 16) {
          const other = ground ?? [all[1][i], all[1][i + 1], all[1][i + 2]];
          count += 1;
          different += other.some((value, c) => Math.abs(value - all[0][i + c]) > 6);
        }
        return different / count;

        async function pixels(png) {
          const blob = await (await fetch(`data:image/png;base64,${png}`)).blob();
          const bitmap = await createImageBitmap(blob);
          const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
          context.drawImage(bitmap, 0, 0);
          return context.getImageData(0, top, bitmap.width, bitmap.height - top - bottom).data;
        }
      },
      [pictures, ground, TOP_PX, BOTTOM_PX],
    );
  }
}

async function readPictures({ source, texts }) {
  const all = await Promise.all(
    texts.map(async (png) => {
      const bitmap = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
      context.drawImage(bitmap, 0, 0);
      return context.getImageData(0, 0, bitmap.width, bitmap.height);
    }),
  );
  return new Function(`return (${source})`)()(...all);
}
