//! The example pages of docs/map-clients as a browser meets them: the pages and the libraries of node_modules out at one address, and a
//! way to the server that counts who comes by, and can be slow or cut.
import { readFile } from "node:fs/promises";
import { createServer, request } from "node:http";

const PAGES = new URL("../../docs/map-clients/", import.meta.url);
const LIBRARIES = new URL("node_modules/", import.meta.url);
const TYPES = { html: "text/html", css: "text/css", js: "text/javascript", mjs: "text/javascript", png: "image/png" };
/** What the pages load from outside, with the version they name. A browser that has requests routed keeps no cache, so the text is changed instead. */
const CDN = /https:\/\/unpkg\.com\/([a-z-]+)@([0-9.]+)\//g;

function listening(server) {
  return new Promise((resolve) => {
    server.listen(0, "127.0.0.1", () => resolve(`http://127.0.0.1:${server.address().port}`));
  });
}

/** Serves the pages, each library from the package that is installed in the version that the page names. */
export async function servePages() {
  const server = createServer(async (asked, answer) => {
    const { pathname } = new URL(asked.url, "http://page");
    try {
      const isLibrary = pathname.startsWith("/library/");
      const file = isLibrary ? new URL(pathname.slice("/library/".length), LIBRARIES) : new URL(`.${pathname}`, PAGES);
      let content = await readFile(file);
      if (pathname.endsWith(".html")) content = await local(String(content));
      answer.writeHead(200, { "content-type": TYPES[pathname.split(".").pop()], "cache-control": "no-store" }).end(content);
    } catch (error) {
      answer.writeHead(404).end(String(error));
    }
  });
  return { url: await listening(server), close: () => server.close() };
}

async function local(page) {
  for (const [, name, version] of page.matchAll(CDN)) {
    const installed = JSON.parse(await readFile(new URL(`${name}/package.json`, LIBRARIES)));
    if (installed.version !== version) throw new Error(`the page names ${name} ${version}, and ${installed.version} is installed`);
  }
  return page.replace(CDN, "/library/$1/");
}

/** Passes everything on to `target`, unless told otherwise; answers may be as old as a cache on the way would say. */
export async function throughTo(target) {
  const way = { asked: [], delayMs: 0, isCut: false, ageS: 0 };
  const server = createServer((asked, answer) => {
    if (way.isCut) return asked.socket.destroy();
    way.asked.push(asked.url);
    setTimeout(() => pass(asked, answer), way.delayMs);
  });
  const pass = (asked, answer) => {
    const { hostname, port } = new URL(target);
    // The host is this one's, so that addresses in answers lead here again.
    const onward = request({ hostname, port, path: asked.url, method: asked.method, headers: asked.headers }, (got) => {
      answer.writeHead(got.statusCode, way.ageS > 0 ? { ...got.headers, age: String(way.ageS) } : got.headers);
      got.pipe(answer);
    });
    onward.on("error", () => asked.socket.destroy());
    // What never ends, such as news, ends with whoever listens.
    answer.on("close", () => onward.destroy());
    asked.pipe(onward);
  };
  way.tiles = () => way.asked.filter((url) => /\/\d+\/\d+\/\d+\.png/.test(url));
  way.url = await listening(server);
  way.close = () => {
    server.closeAllConnections();
    server.close();
  };
  return way;
}
