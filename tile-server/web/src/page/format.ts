//! Pure formatting: unit strings and numbers in, text with proper minus signs, superscripts and subscripts out.

const SUPERSCRIPT: Record<string, string> = {
  "-": "⁻",
  "+": "⁺",
  "0": "⁰",
  "1": "¹",
  "2": "²",
  "3": "³",
  "4": "⁴",
  "5": "⁵",
  "6": "⁶",
  "7": "⁷",
  "8": "⁸",
  "9": "⁹",
};
const THIN_SPACE = "\u2009";
const NARROW_NO_BREAK_SPACE = "\u202f";
const MINUS = "\u2212";

/** `g C m-2 yr-1`, `m^-2` or `m**-2` become `g C m⁻² yr⁻¹`; text that is set already stays as it is. */
export function unitText(unit: string): string {
  // Formulas first: the 2 of CO2 is an index, the 2 of m2 a power.
  return chemistry(unit.trim())
    .replace(
      /([A-Za-zµμ%°])(?:\^|\*\*)?([-+]?\d+)(?=$|[\s/·.)])/g,
      (_match, symbol: string, power: string) => symbol + superscript(power),
    )
    .replace(/\bdegC\b|\bdegree_?[Cc]elsius\b/g, "°C")
    .replace(/\s+/g, NARROW_NO_BREAK_SPACE);
}

/** CO2, pCO2, fCO2 get their subscript; used for titles too. */
export function chemistry(text: string): string {
  return text.replace(/CO2/g, "CO₂").replace(/\bO2\b/g, "O₂");
}

function superscript(power: string): string {
  return [...power].map((sign) => SUPERSCRIPT[sign] ?? sign).join("");
}

/** A number with `digits` decimals, thin spaces between thousands and a true minus sign; no-data is an en dash. */
export function numberText(value: number | null | undefined, digits: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const [whole = "0", fraction] = Math.abs(value).toFixed(digits).split(".");
  const grouped = whole.replace(/\B(?=(\d{3})+$)/g, THIN_SPACE);
  const text = fraction ? `${grouped}.${fraction}` : grouped;
  // A rounded zero has no sign: "−0.0" would tell the reader something that the digits do not.
  const isZero = !/[1-9]/.test(text);
  return value < 0 && !isZero ? MINUS + text : text;
}

/** Numbers below this are written with an exponent: so many decimals nobody counts. */
const LEAST_WRITTEN = 1e-5;
/** Decimals of four figures of the least number that is written without an exponent. */
const MOST_DECIMALS = 8;

/** Decimals that show about `significant` figures of numbers as large as `magnitude`, 0 to 8. */
export function digitsFor(magnitude: number, significant: number): number {
  if (!Number.isFinite(magnitude) || magnitude === 0) return 2;
  const leading = Math.floor(Math.log10(Math.abs(magnitude)));
  return Math.min(MOST_DECIMALS, Math.max(0, significant - 1 - leading));
}

/** `2.5e−9`: at most `significant` figures and an exponent; zero is zero. */
export function exponentText(value: number, significant: number): string {
  if (value === 0) return "0";
  const [figures = "", power] = value.toExponential(significant - 1).split("e");
  const short = figures.includes(".") ? figures.replace(/\.?0+$/, "") : figures;
  return `${short}e${Number(power)}`.replaceAll("-", MINUS);
}

/** One of several numbers of which the largest has about `significant` figures, and all the same decimals. */
export function alikeText(value: number | null | undefined, largest: number, significant = 4): string {
  const isTiny = largest !== 0 && Math.abs(largest) < LEAST_WRITTEN;
  const isNumber = value !== null && value !== undefined && Number.isFinite(value);
  if (isTiny && isNumber) return exponentText(value, significant);
  return numberText(value, digitsFor(largest, significant));
}

/** A single value with about `significant` figures. */
export function valueText(value: number | null | undefined, significant = 4): string {
  return alikeText(value, value ?? 0, significant);
}

/** `12.50° N`; zero has no hemisphere. */
export function latText(latDeg: number, digits = 2): string {
  return degreesText(latDeg, digits, latDeg >= 0 ? "N" : "S");
}

/** `45.00° W`; longitudes are brought to -180..180 first. */
export function lonText(lonDeg: number, digits = 2): string {
  const wrapped = wrapLon(lonDeg);
  return degreesText(wrapped, digits, wrapped >= 0 ? "E" : "W");
}

function degreesText(degrees: number, digits: number, hemisphere: string): string {
  const text = Math.abs(degrees).toFixed(digits);
  return Number(text) === 0 ? `${text}°` : `${text}° ${hemisphere}`;
}

export function wrapLon(lonDeg: number): number {
  const turned = (((lonDeg + 180) % 360) + 360) % 360;
  return turned - 180;
}

/** Area in m² as millions of km², the size people know oceans by. */
export function areaText(areaM2: number): string {
  return `${valueText(areaM2 / 1e12)} million km²`;
}

/** A product's title that says so where the data are made up, once. */
export function titleText(product: { title: string; synthetic: boolean }): string {
  const says = /synthetic/i.test(product.title);
  return chemistry(product.title) + (product.synthetic && !says ? " (synthetic)" : "");
}

/** Titles of a list: products of one title, as of files that say the same of themselves, are told apart by their names. */
export function titleTexts(products: readonly { product: string; title: string; synthetic: boolean }[]): string[] {
  const titles = products.map(titleText);
  const isAlone = (title: string): boolean => titles.filter((other) => other === title).length === 1;
  return products.map(({ product }, index) => {
    const title = titles[index] ?? product;
    return isAlone(title) ? title : `${title} (${product})`;
  });
}
