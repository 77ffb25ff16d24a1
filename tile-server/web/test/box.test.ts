//! Boxes on the globe: the short way round, the date line, typed text and outlines.
import { describe, expect, it } from "vitest";
import { boxFromCorners, boxText, contains, outline, parseBox } from "../src/globe/box";

describe("a drawn box", () => {
  it("is the same from either corner", () => {
    const a = { lon: -30, lat: 10 };
    const b = { lon: 20, lat: -5 };
    expect(boxFromCorners(a, b)).toEqual([-30, -5, 20, 10]);
    expect(boxFromCorners(b, a)).toEqual([-30, -5, 20, 10]);
  });

  it("crosses the date line where that is the short way", () => {
    expect(boxFromCorners({ lon: 170, lat: 0 }, { lon: -170, lat: 10 })).toEqual([170, 0, -170, 10]);
    expect(boxFromCorners({ lon: -170, lat: 10 }, { lon: 170, lat: 0 })).toEqual([170, 0, -170, 10]);
  });
});

describe("a typed box", () => {
  it("is read with commas or spaces and written back", () => {
    expect(parseBox("100, 0, 130, 41")).toEqual([100, 0, 130, 41]);
    expect(parseBox("100 0 130 41")).toEqual([100, 0, 130, 41]);
    expect(boxText([100, 0, 130, 41])).toBe("100,0,130,41");
  });

  it("says what is wrong with it", () => {
    expect(parseBox("1,2,3")).toMatch(/Four numbers/);
    expect(parseBox("a,b,c,d")).toMatch(/numbers/);
    expect(parseBox("0,20,10,10")).toMatch(/South/);
    expect(parseBox("0,-95,10,10")).toMatch(/Latitudes/);
    expect(parseBox("-200,0,10,10")).toMatch(/Longitudes/);
    expect(parseBox("10,0,10,10")).toMatch(/same/);
  });
});

describe("inside", () => {
  it("knows the date line", () => {
    expect(contains([170, -10, -170, 10], { lon: 179, lat: 0 })).toBe(true);
    expect(contains([170, -10, -170, 10], { lon: -175, lat: 0 })).toBe(true);
    expect(contains([170, -10, -170, 10], { lon: 0, lat: 0 })).toBe(false);
  });

  it("knows the whole globe", () => {
    expect(contains([-180, -90, 180, 90], { lon: -150, lat: 8 })).toBe(true);
  });
});

describe("an outline", () => {
  it("is closed, dense and goes the short way over the date line", () => {
    const lines = outline([170, -10, -170, 10], 2);
    expect(lines).toHaveLength(1);
    const line = lines[0]!;
    expect(line[0]).toEqual(line[line.length - 1]);
    expect(Math.max(...line.map((point) => point.lon))).toBe(190);
    for (let i = 1; i < line.length; i++) {
      const [a, b] = [line[i - 1]!, line[i]!];
      expect(Math.abs(a.lon - b.lon) + Math.abs(a.lat - b.lat)).toBeLessThanOrEqual(2);
      expect(a).not.toEqual(b);
    }
  });

  it("of a band around the globe is its two parallels, and of everything nothing", () => {
    const lines = outline([-180, 14, 180, 50]);
    expect(lines.map((line) => [...new Set(line.map((point) => point.lat))])).toEqual([[14], [50]]);
    expect(outline([-180, -90, 180, 90])).toEqual([]);
    expect(outline([-180, -90, 180, -62])).toHaveLength(1);
  });
});
