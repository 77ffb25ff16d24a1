//! Units and numbers as text: the signs a reader of a journal expects.
import { describe, expect, it } from "vitest";
import {
  alikeText,
  areaText,
  chemistry,
  digitsFor,
  exponentText,
  latText,
  lonText,
  numberText,
  titleText,
  titleTexts,
  unitText,
  valueText,
  wrapLon,
} from "../src/page/format";

const plain = (text: string): string => text.replace(/\u202f/g, " ").replace(/\u2009/g, "_");

describe("units", () => {
  it("get superscripts in every common spelling", () => {
    for (const spelling of ["g C m-2 yr-1", "g C m^-2 yr^-1", "g C m**-2 yr**-1", "g C m⁻² yr⁻¹"]) {
      expect(plain(unitText(spelling))).toBe("g C m⁻² yr⁻¹");
    }
    expect(plain(unitText("m2"))).toBe("m²");
    expect(plain(unitText("mmol m-2 d-1"))).toBe("mmol m⁻² d⁻¹");
  });

  it("keep names that end in a digit", () => {
    expect(plain(unitText("mol CO2 m-2 s-1"))).toBe("mol CO₂ m⁻² s⁻¹");
    expect(plain(unitText("Tg C"))).toBe("Tg C");
  });

  it("write degrees Celsius", () => {
    expect(unitText("degC")).toBe("°C");
  });

  it("set the subscript in words", () => {
    expect(chemistry("pCO2 and CO2 flux")).toBe("pCO₂ and CO₂ flux");
  });
});

describe("numbers", () => {
  it("have true minus signs and thin spaces", () => {
    expect(plain(numberText(-1404.36, 1))).toBe("−1_404.4");
    expect(plain(numberText(1234567, 0))).toBe("1_234_567");
    expect(plain(numberText(999, 0))).toBe("999");
  });

  it("give a rounded zero no sign", () => {
    expect(numberText(-0.04, 1)).toBe("0.0");
    expect(numberText(-0.06, 1)).toBe("−0.1");
  });

  it("show no data as a dash", () => {
    for (const nothing of [null, undefined, Number.NaN]) expect(numberText(nothing, 2)).toBe("–");
  });

  it("choose decimals by size", () => {
    expect([1404, 66, 4.8, 0.012].map((size) => digitsFor(size, 4))).toEqual([0, 2, 3, 5]);
  });

  it("are no zeros, however small they are", () => {
    expect([1.234e-5, -2e-5, 1.23e-6, -4e-11, 5e-324].map((value) => valueText(value, 3))).toEqual([
      "0.0000123",
      "−0.0000200",
      "1.23e−6",
      "−4e−11",
      "4.94e−324",
    ]);
    expect([0, -0].map((value) => valueText(value))).toEqual(["0.00", "0.00"]);
    expect([1, 2e9, 2.5e-9].map((value) => exponentText(value, 6))).toEqual(["1e0", "2e9", "2.5e−9"]);
    expect(exponentText(3e-9, 1)).toBe("3e−9");
  });

  it("beside each other have the decimals of the largest", () => {
    expect([27.03, -0.004, 0, null].map((value) => alikeText(value, 27.03))).toEqual(["27.03", "0.00", "0.00", "–"]);
    expect([2.5e-7, -4e-9, 0, null].map((value) => alikeText(value, 2.5e-7))).toEqual(["2.5e−7", "−4e−9", "0", "–"]);
    expect(alikeText(0, 0)).toBe("0.00");
  });

  it("write areas in million square kilometres", () => {
    expect(areaText(334.1e12)).toBe("334.1 million km²");
    expect(areaText(100)).toBe("1e−10 million km²");
  });
});

describe("places", () => {
  it("have hemispheres, except on the lines", () => {
    expect(latText(-12.5)).toBe("12.50° S");
    expect(latText(-0.001)).toBe("0.00°");
    expect(lonText(210)).toBe("150.00° W");
    expect(lonText(0)).toBe("0.00°");
  });

  it("wrap to -180..180", () => {
    expect([-190, -180, 0, 179, 180, 540, 725].map(wrapLon)).toEqual([170, -180, 0, 179, -180, -180, 5]);
  });
});

describe("titles", () => {
  it("say once that data are made up", () => {
    expect(titleText({ title: "CO2 flux", synthetic: false })).toBe("CO₂ flux");
    expect(titleText({ title: "CO2 flux", synthetic: true })).toBe("CO₂ flux (synthetic)");
    expect(titleText({ title: "SYNTHETIC China Sea", synthetic: true })).toBe("SYNTHETIC China Sea");
  });

  it("tell products of one title apart by their names", () => {
    const product = (name: string, title: string) => ({ product: name, title, synthetic: false });
    const told = titleTexts([product("a", "CO2 flux"), product("b", "Wind"), product("c", "CO2 flux")]);
    expect(told).toEqual(["CO₂ flux (a)", "Wind", "CO₂ flux (c)"]);
  });
});
