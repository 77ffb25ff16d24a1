//! Cameras against hand values of the sphere, pictures moved to other cameras against what those see, and addresses of views.
import { describe, expect, it } from "vitest";
import type { LayerSpec } from "../src/globe/layer";
import { USUAL } from "../src/look/look";
import { type CameraView, SPHERE_RADIUS_M } from "../src/state/camera";
import { ACROSS, DOWN, meshOf, placeIn } from "../src/stream/mesh";
import { groundAlong, isHidden, onGround, poseOf, seen, sight } from "../src/stream/pose";
import { isSameCamera, type Scene, viewAddress } from "../src/stream/view";

const [WIDTH, HEIGHT] = [1280, 800];
const RADIUS_KM = SPHERE_RADIUS_M / 1000;
const NADIR: CameraView = { lon: 0, lat: 0, heightKm: RADIUS_KM, headingDeg: 0, pitchDeg: -90, rollDeg: 0 };
const LOW: CameraView = { lon: -104, lat: -6, heightKm: 1300, headingDeg: 78, pitchDeg: -23, rollDeg: 0 };
const poseIn = (camera: CameraView) => poseOf(camera, WIDTH, HEIGHT);

describe("a camera", () => {
  it("straight above sees what lies below in the middle, east to the right and north above", () => {
    const pose = poseIn(NADIR);
    expect(seen(pose, onGround(0, 0))).toEqual({ x: 640, y: 400 });
    // From two radii off the limb is 30 degrees away and touches the ground 60 degrees off.
    const limb = seen(pose, onGround(60, 0));
    const focalPx = 400 / Math.tan(Math.PI / 8);
    expect(limb?.x).toBeCloseTo(640 + focalPx * Math.tan(Math.PI / 6), 6);
    expect(limb?.y).toBeCloseTo(400, 6);
    expect(seen(pose, onGround(0, 10))?.y).toBeLessThan(400);
  });

  it("that looks along the ground has the zenith above and what is ahead in the middle", () => {
    const pose = poseIn({ ...NADIR, heightKm: 1, headingDeg: 90, pitchDeg: 0 });
    expect(seen(pose, onGround(5, 0, 1e6))?.x).toBeCloseTo(640, 6);
    expect(seen(pose, onGround(5, 0, 1e6))?.y).toBeLessThan(400);
    expect(seen(pose, onGround(-5, 0))).toBeUndefined();
    // What lies north is to the left of a camera that looks east.
    expect(seen(pose, onGround(5, 1))?.x).toBeLessThan(640);
  });

  it("that leans to the right sees the horizon turned to the left", () => {
    const level = { ...NADIR, heightKm: 100, pitchDeg: -10 };
    const ahead = onGround(3, 5);
    const upright = seen(poseIn(level), ahead);
    const leaning = seen(poseIn({ ...level, rollDeg: 30 }), ahead);
    expect((leaning?.y ?? 0) - (upright?.y ?? 0)).toBeLessThan(0);
  });

  it("meets the ground where it sees it", () => {
    const pose = poseIn(LOW);
    for (const point of [{ x: 200, y: 700 }, { x: 640, y: 650 }, { x: 1200, y: 780 }]) {
      const ground = groundAlong(pose, sight(pose, point));
      const again = ground && seen(pose, ground);
      expect(again?.x).toBeCloseTo(point.x, 6);
      expect(again?.y).toBeCloseTo(point.y, 6);
    }
    expect(groundAlong(poseIn({ ...LOW, pitchDeg: 20 }), sight(poseIn({ ...LOW, pitchDeg: 20 }), { x: 640, y: 0 }))).toBeUndefined();
  });

  it("does not see through the globe", () => {
    const pose = poseIn(NADIR);
    expect([isHidden(pose, onGround(59, 0)), isHidden(pose, onGround(61, 0)), isHidden(pose, onGround(180, 0))]).toEqual([false, true, true]);
    // What stands high enough looks over the horizon.
    expect(isHidden(pose, onGround(61, 0, 1e6))).toBe(false);
  });
});

describe("a picture of another camera", () => {
  const low = poseIn(LOW);

  it("of the same camera stays where it is", () => {
    const { places, cover, lean } = meshOf(low, low);
    expect([cover, lean, places.length]).toEqual([1, 0, 3 * (ACROSS + 1) * (DOWN + 1)]);
    for (let at = 0, knot = 0; at < places.length; at += 3, knot++) {
      expect(places[at]).toBeCloseTo((knot % (ACROSS + 1)) / ACROSS, 5);
      expect(places[at + 1]).toBeCloseTo(Math.floor(knot / (ACROSS + 1)) / DOWN, 5);
      expect(places[at + 2]).toBe(1);
    }
  });

  it("shows the ground where the other camera sees it, wherever that went", () => {
    const now = poseIn({ lon: -98, lat: -2, heightKm: 1700, headingDeg: 60, pitchDeg: -40, rollDeg: 5 });
    for (const place of [onGround(-90, 3), onGround(-94, 0), onGround(-95, 5)]) {
      const at = placeIn(low, now, seen(now, place) ?? { x: 0, y: 0 });
      const was = seen(low, place);
      expect(at?.x).toBeCloseTo(was?.x ?? Number.NaN, 6);
      expect(at?.y).toBeCloseTo(was?.y ?? Number.NaN, 6);
    }
  });

  it("does not tear at the horizon", () => {
    const now = poseIn({ ...LOW, lon: LOW.lon + 4, pitchDeg: -30 });
    const isGround = (y: number) => groundAlong(now, sight(now, { x: 640, y })) !== undefined;
    let y = 0;
    while (!isGround(y)) y += 0.25;
    expect(y).toBeGreaterThan(0);
    const [above, below] = [placeIn(low, now, { x: 640, y: y - 0.25 }), placeIn(low, now, { x: 640, y: y + 0.25 })];
    expect(Math.hypot((above?.x ?? 0) - (below?.x ?? 999), (above?.y ?? 0) - (below?.y ?? 999))).toBeLessThan(12);
  });

  it("leans with the way, and covers nothing of what its camera could not see", () => {
    const near = meshOf(low, poseIn({ ...LOW, lon: LOW.lon + 0.5 }));
    expect([near.lean < 0.1, near.cover > 0.8]).toEqual([true, true]);
    expect(meshOf(low, poseIn({ ...LOW, lon: LOW.lon + 60 })).lean).toBeGreaterThan(2);
    expect(meshOf(low, poseIn({ ...LOW, headingDeg: LOW.headingDeg + 180 })).cover).toBeLessThan(0.2);
  });
});

describe("a view's address", () => {
  const spec: LayerSpec = {
    product: "wu 2018",
    manifest: "m-3",
    revision: 0,
    mode: "volume",
    look: { ...USUAL, sunOfTime: true },
    timeIso: "2000-07-01T00:00:00Z",
    bounds: [-180, -90, 180, 90],
  };
  const scene: Scene = { spec, camera: { ...LOW, lon: -104.1234567, rollDeg: -0.0001 }, width: WIDTH, height: HEIGHT, density: 2 };

  it("says all that the picture depends on, in pixels of the screen", () => {
    const address = new URL(viewAddress(scene), "http://here");
    expect(address.pathname).toBe("/globe/wu%202018/volume.png");
    expect(Object.fromEntries(address.searchParams)).toEqual({
      lon: "-104.12346",
      lat: "-6",
      height_km: "1300",
      heading: "78",
      tilt: "67",
      roll: "0",
      fov: "45",
      time: "2000-07-01T00:00:00Z",
      width: "2560",
      height: "1600",
      manifest: "m-3",
      sun: "time",
      coastlines: "false",
    });
  });

  it("asks for no more pixels a side than the server draws", () => {
    const { searchParams } = new URL(viewAddress({ ...scene, density: 4 }), "http://here");
    expect([searchParams.get("width"), searchParams.get("height")]).toEqual(["4096", "2560"]);
  });

  it("is of the same camera only in the same window", () => {
    expect(isSameCamera(scene, { ...scene, camera: { ...scene.camera }, density: 1 })).toBe(true);
    expect(isSameCamera(scene, { ...scene, width: 900 })).toBe(false);
    expect(isSameCamera(scene, { ...scene, camera: { ...scene.camera, pitchDeg: -24 } })).toBe(false);
  });
});
