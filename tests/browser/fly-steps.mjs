//! Steps that fly: the live picture comes over a WebSocket, follows camera and time, and gives way to tiles where there is none.
import assert from "node:assert/strict";
import { flown, hasStream, NO_STREAM, picture, query, rests } from "./flight.mjs";
import { eventually } from "./reading.mjs";

/** What a browser that reads positions from its own camera and writes them with three digits may be off, degrees. */
const NEAR_DEG = 0.01;

function assertSameCamera(view, camera) {
  const turned = (((Number(view.heading) - camera.headingDeg) % 360) + 540) % 360 - 180;
  assert.ok(Math.abs(turned) < NEAR_DEG, `heading ${view.heading} must be ${camera.headingDeg}`);
  assert.ok(Math.abs(Number(view.tilt) - 90 - camera.pitchDeg) < NEAR_DEG, `tilt ${view.tilt} must be ${90 + camera.pitchDeg}`);
  assert.ok(Math.abs(Number(view.height_km) / camera.heightKm - 1) < 1e-3);
}

/** Colours of the picture over the globe: how many of its pixels are not black. */
function lit(page) {
  return page.locator("#overlay .picture").evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i] + data[i + 1] + data[i + 2] > 24) count += 1;
    return count;
  });
}

export async function opensInFlight(journey) {
  if (!(await hasStream(journey.base))) return NO_STREAM;
  await flown(journey, ".", async (flight) => {
    const { page } = flight;
    const { mode, camera, look } = await flight.state();
    assert.equal(mode, "volume");
    assert.ok(camera.pitchDeg > -60, "the page opens tilted");
    assert.equal(look.coastlines, true);
    await rests(flight);
    const shown = await picture(flight);
    const view = query(shown);
    assertSameCamera(view, camera);
    const size = await page.locator("#globe").boundingBox();
    assert.deepEqual([shown.width, shown.height, Number(view.width)], [size.width, size.height, size.width]);
    assert.ok((await lit(page)) > 10_000, "the picture must show something");
    assert.equal(await page.locator("#live").isChecked(), true);
    // What cards hide is theirs: pictures lie below them, and take no click.
    await page.locator("#product").click({ trial: true });
    await page.keyboard.press("f");
    await page.locator("#readout", { hasText: /full picture/ }).waitFor();
    await flight.shot("flight");
  });
}

/** Turned and tilted by hand. While it moves pictures of any size will do; when it rests the full one must come. */
export async function pictureFollowsCamera(journey) {
  if (!(await hasStream(journey.base))) return NO_STREAM;
  await flown(journey, ".", async (flight) => {
    const { page } = flight;
    await rests(flight);
    const before = { camera: (await flight.state()).camera, shown: await page.evaluate(() => window.fluxglobe.pictures.shown) };
    const box = await page.locator("#globe").boundingBox();
    const [x, y] = [box.width * 0.55, box.height * 0.7];
    await page.mouse.move(x, y);
    await page.mouse.down({ button: "middle" });
    await page.mouse.move(x + 60, y + 40, { steps: 12 });
    await page.mouse.up({ button: "middle" });
    await flight.until((shown) => window.fluxglobe.pictures.shown > shown, before.shown);
    await eventually(async () => {
      const { camera } = await flight.state();
      assert.ok(Math.abs(camera.pitchDeg - before.camera.pitchDeg) > 1, "the drag must have tilted the camera");
      const shown = await picture(flight);
      assert.equal(shown?.kind, "full");
      assertSameCamera(query(shown), camera);
    });
    await flight.shot("flight-tilted");
  });
}

/** The legend is that of the picture in sight; sliders move the picture while they are moved. */
export async function pictureFollowsLook(journey) {
  if (!(await hasStream(journey.base))) return NO_STREAM;
  await flown(journey, ".", async (flight) => {
    const { page } = flight;
    await rests(flight);
    const bar = () => page.locator("#legend .legend-bar").evaluate((element) => element.style.background);
    const before = await bar();
    await page.locator("#tab-look").click();
    await page.locator('input[name="palette"]:checked').press("ArrowDown");
    const { palette } = (await flight.state()).look;
    await flight.until((name) => window.fluxglobe.picture?.view.includes(`palette=${name}`), palette);
    await eventually(async () => assert.notEqual(await bar(), before));
    const height = page.locator("#height-exaggeration");
    if (await height.isVisible()) {
      await height.evaluate((input) => {
        input.value = "12000";
        // As a thumb that is not let go yet.
        input.dispatchEvent(new Event("input"));
      });
      await flight.until(() => window.fluxglobe.picture?.view.includes("height_exaggeration=12000000"));
    }
    await page.locator("#sun").selectOption("time");
    await flight.until(() => window.fluxglobe.picture?.view.includes("sun=time"));
    await rests(flight);
    await flight.shot("flight-look");
  });
}

/** Without a pointer: arrow keys with Shift tilt the camera where it is. */
export async function keysTilt(journey) {
  if (!(await hasStream(journey.base))) return NO_STREAM;
  await flown(journey, ".", async (flight) => {
    const { page } = flight;
    await rests(flight);
    const before = (await flight.state()).camera;
    await page.locator("#globe canvas").focus();
    for (const key of ["Shift+ArrowUp", "Shift+ArrowUp", "Shift+ArrowRight"]) await page.keyboard.press(key);
    await eventually(async () => {
      const { camera } = await flight.state();
      assert.ok(Math.abs(camera.pitchDeg - before.pitchDeg - 6) < NEAR_DEG && Math.abs(camera.lon - before.lon) < NEAR_DEG);
      const shown = await picture(flight);
      assert.equal(shown?.kind, "full");
      assertSameCamera(query(shown), camera);
    });
  });
}

/** Time runs through the stream alone: tiles that nobody sees are not asked for. Where it stops the full picture comes. */
export async function pictureFollowsTime(journey) {
  if (!(await hasStream(journey.base))) return NO_STREAM;
  await flown(journey, ".", async (flight) => {
    const { page, watch } = flight;
    await rests(flight);
    const from = watch.responses.length;
    const before = query(await picture(flight)).time;
    await page.locator("#play").click();
    await flight.until((time) => !window.fluxglobe.picture?.view.includes(`time=${time}`), before);
    await page.locator("#play").click();
    await flight.until(() => window.fluxglobe.state.playing === false);
    await rests(flight);
    const box = await page.locator("#time").boundingBox();
    await page.mouse.move(box.x + box.width * 0.2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width * 0.55, box.y + box.height / 2, { steps: 8 });
    assert.ok(await picture(flight), "a picture stays while the slider moves");
    await page.mouse.up();
    await rests(flight);
    assert.deepEqual(watch.tiles("volume", from), []);
  });
}

/** The globe's library and the server's renderer put the same places onto the same pixels, and so does the picture: lines of a graticule are where they are reckoned. */
export async function globesAgree(journey) {
  if (!(await hasStream(journey.base))) return NO_STREAM;
  await flown(journey, ".", async (flight) => {
    const { page, base } = flight;
    await rests(flight);
    const { view } = await picture(flight);
    const far = await page.evaluate(
      async ({ view, base }) => {
        const at = (lon, lat) => [window.fluxglobe.project(lon, lat), window.fluxglobe.projectAsDrawn(lon, lat)];
        const points = [];
        for (let lon = -85; lon <= -50; lon += 5) for (let lat = -20; lat <= 15; lat += 5) points.push([lon, lat]);
        const seen = points.map(([lon, lat]) => ({ lon, lat, at: at(lon, lat) })).filter(({ at: [globe] }) => globe);
        const apart = seen.map(({ at: [globe, drawn] }) => Math.hypot(globe.x - drawn.x, globe.y - drawn.y));
        const pixels = async (change) => {
          // Flat on the ground, where particles do not stand before the lines.
          const url = new URL(view.replace("/volume.png", "/map.png"), base);
          for (const [name, value] of Object.entries(change)) url.searchParams.set(name, value);
          const image = await createImageBitmap(await (await fetch(url)).blob());
          const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
          context.drawImage(image, 0, 0);
          return context.getImageData(0, 0, image.width, image.height);
        };
        const [without, lined] = [await pixels({}), await pixels({ graticule: "5" })];
        const isLine = (x, y) => {
          const i = 4 * (y * without.width + x);
          return [0, 1, 2].some((k) => Math.abs((without.data[i + k] ?? 0) - (lined.data[i + k] ?? 0)) > 5);
        };
        const nearest = ({ x, y }) => {
          for (let reach = 0; reach < 12; reach++)
            for (let dx = -reach; dx <= reach; dx++)
              for (let dy = -reach; dy <= reach; dy++) if (isLine(Math.round(x) + dx, Math.round(y) + dy)) return reach;
          return 12;
        };
        const inside = seen.filter(({ at: [, { x, y }] }) => x > 0 && y > 0 && x < without.width && y < without.height);
        const lines = inside.map(({ at: [, point] }) => nearest(point));
        // A camera that is a degree or so off must be noticed.
        const planted = inside.map(({ at: [, { x, y }] }) => nearest({ x: x + 11, y: y + 6 }));
        return { apart: Math.max(...apart), seen: seen.length, lines, planted };
      },
      { view, base: base.href },
    );
    assert.ok(far.seen > 10 && far.lines.length > 5, JSON.stringify(far));
    assert.ok(far.apart < 0.5, `globe and renderer must agree to half a pixel, they are ${far.apart} apart`);
    const hit = (distances) => distances.filter((px) => px <= 2).length / distances.length;
    assert.ok(hit(far.lines) >= 0.9, `lines must lie where they are reckoned: ${far.lines}`);
    assert.ok(hit(far.planted) < 0.6, `planted: lines a little off must be noticed: ${far.planted}`);
  });
}

export async function liveIsSwitchedOff(journey) {
  if (!(await hasStream(journey.base))) return NO_STREAM;
  await flown(journey, ".", async (flight) => {
    const { page } = flight;
    await rests(flight);
    await page.locator("#live").uncheck();
    await flight.until(() => window.fluxglobe.picture === undefined);
    await flight.until(() => window.fluxglobe.shown?.includes("/volume") && window.fluxglobe.tilesPending === 0);
    await eventually(() => assert.match(page.url(), /[#&]live=off/));
    await page.locator("#live").check();
    await rests(flight);
    await eventually(() => assert.doesNotMatch(page.url(), /live=off/));
  });
}

/** An older server, or one with too many guests: the page opens as it did, and shows tiles in every mode. */
export async function staysWithTiles(journey) {
  const refuse = (page) =>
    page.addInitScript(() => {
      window.WebSocket = class {
        constructor() {
          setTimeout(() => this.onclose?.({}), 0);
        }
        send() {}
        close() {}
      };
    });
  await flown(
    journey,
    ".",
    async (flight) => {
      const { page } = flight;
      assert.equal((await flight.state()).mode, "map");
      await flight.until(() => window.fluxglobe.shown?.includes("/map"));
      await page.locator('button[data-mode="volume"]').click();
      await flight.until(() => window.fluxglobe.shown?.includes("/volume") && window.fluxglobe.tilesPending === 0);
      assert.equal(await picture(flight), undefined);
      await page.locator("#live-status", { hasText: /not available/ }).waitFor();
      assert.equal(await page.locator(".notice").count(), 0, "nobody is told");
    },
    refuse,
  );
}
