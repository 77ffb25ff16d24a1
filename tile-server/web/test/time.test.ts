//! Time maths against hand values: months of unequal length, holes between steps, the raster and the loop of playback.
import { describe, expect, it } from "vitest";
import {
  advanced,
  clampToRange,
  formatInstant,
  instantAt,
  isOutside,
  labelledEvery,
  nextInstant,
  outsideText,
  parseSteps,
  positionOf,
  quantise,
  rangeOf,
  type Step,
  stepAhead,
  stepBeside,
  stepLabel,
  strideFor,
  timeNames,
  toIso,
} from "../src/time/steps";

const at = (iso: string): number => Date.parse(iso);
const month = (start: string, end: string): { start: string; end: string; mid: string } => ({
  start,
  end,
  mid: toIso((at(start) + at(end)) / 2),
});
const JAN = month("2000-01-01T00:00:00Z", "2000-02-01T00:00:00Z");
const FEB = month("2000-02-01T00:00:00Z", "2000-03-01T00:00:00Z");
const MAY = month("2000-05-01T00:00:00Z", "2000-06-01T00:00:00Z");
const STEPS = parseSteps([JAN, FEB, MAY]);

describe("steps", () => {
  it("are sorted and broken ones are left out", () => {
    const parsed = parseSteps([FEB, { start: "soon", end: "later", mid: "between" }, JAN]);
    expect(parsed.map((step) => toIso(step.startMs))).toEqual([JAN.start, FEB.start]);
  });

  it("span from the first start to the last end", () => {
    expect(rangeOf(STEPS)).toEqual({ startMs: at(JAN.start), endMs: at(MAY.end) });
    expect(rangeOf([])).toBeUndefined();
  });
});

describe("positions", () => {
  it("count whole steps and parts of unequal months", () => {
    expect(positionOf(STEPS, at("2000-01-01T00:00:00Z"))).toBe(0);
    expect(positionOf(STEPS, at("2000-01-16T12:00:00Z"))).toBe(0.5);
    expect(positionOf(STEPS, at("2000-02-15T12:00:00Z"))).toBe(1.5);
    expect(positionOf(STEPS, at("2000-06-01T00:00:00Z"))).toBe(3);
  });

  it("put a hole between two steps at the start of the later one", () => {
    expect(positionOf(STEPS, at("2000-04-10T00:00:00Z"))).toBe(2);
  });

  it("come back as the same instants", () => {
    for (const iso of ["2000-01-09T06:00:00Z", "2000-02-29T23:59:59Z", "2000-05-31T00:00:00Z"]) {
      expect(toIso(Math.round(instantAt(STEPS, positionOf(STEPS, at(iso)))))).toBe(iso);
    }
  });

  it("are clamped to the range", () => {
    expect(clampToRange(STEPS, at("1999-01-01T00:00:00Z"))).toBe(at(JAN.start));
    expect(clampToRange(STEPS, at("2001-01-01T00:00:00Z"))).toBe(at(MAY.end));
    expect(instantAt(STEPS, -4)).toBe(at(JAN.start));
    expect(instantAt(STEPS, 99)).toBe(at(MAY.end));
  });
});

describe("the raster", () => {
  it("has eight instants in a step", () => {
    // A sixteenth of January's 31 days is 1.9375 days: below it the start is nearer, above it the first eighth.
    expect(toIso(quantise(STEPS, at("2000-01-02T20:00:00Z")))).toBe("2000-01-01T00:00:00Z");
    expect(toIso(quantise(STEPS, at("2000-01-03T00:00:00Z")))).toBe("2000-01-04T21:00:00Z");
  });

  it("keeps an instant that lies on it", () => {
    expect(quantise(STEPS, quantise(STEPS, at("2000-02-11T07:31:12Z")))).toBe(
      quantise(STEPS, at("2000-02-11T07:31:12Z")),
    );
  });
});

describe("playback", () => {
  it("advances by parts of a step", () => {
    expect(toIso(nextInstant(STEPS, at("2000-01-01T00:00:00Z"), 1))).toBe("2000-01-04T21:00:00Z");
    expect(toIso(nextInstant(STEPS, at("2000-01-01T00:00:00Z"), 4))).toBe("2000-01-16T12:00:00Z");
  });

  it("lands on multiples of its stride, so that a slow pass finds the tiles of a slow pass", () => {
    expect(toIso(nextInstant(STEPS, at("2000-01-04T21:00:00Z"), 4))).toBe("2000-01-16T12:00:00Z");
  });

  it("goes from the end to the start", () => {
    expect(toIso(nextInstant(STEPS, at("2000-05-28T03:00:00Z"), 1))).toBe("2000-01-01T00:00:00Z");
    expect(toIso(nextInstant(STEPS, at("2000-06-01T00:00:00Z"), 8))).toBe("2000-01-01T00:00:00Z");
  });

  it("visits every raster instant once a loop", () => {
    const seen = new Set<number>();
    let now = at(JAN.start);
    for (let i = 0; i < STEPS.length * 8; i++) {
      seen.add(now);
      now = nextInstant(STEPS, now, 1);
    }
    expect(seen.size).toBe(24);
    expect(now).toBe(at(JAN.start));
  });

  it("takes longer strides when a frame needs longer than it may, up to a whole step", () => {
    expect(strideFor(100, 125)).toBe(1);
    expect(strideFor(200, 125)).toBe(2);
    expect(strideFor(1e6, 125)).toBe(8);
  });
});

describe("stored steps", () => {
  const middles = STEPS.map((step) => step.atMs);
  const [january, february, may] = middles as [number, number, number];

  it("are where play that pauses goes on to, never back, and at the end of the record the last one is", () => {
    expect(["2000-01-01T00:00:00Z", "2000-01-16T12:00:00Z"].map((iso) => stepAhead(STEPS, at(iso)))).toEqual([january, january]);
    expect(["2000-01-16T12:00:02Z", "2000-02-03T00:00:00Z"].map((iso) => stepAhead(STEPS, at(iso)))).toEqual([february, february]);
    expect([FEB.end, MAY.end].map((iso) => stepAhead(STEPS, at(iso)))).toEqual([may, may]);
    expect(stepAhead([], 5)).toBe(5);
  });

  it("hold where an address, which has whole seconds, names one", () => {
    const odd = parseSteps([{ start: "2000-01-01T00:00:00Z", mid: "2000-01-01T00:00:01.500Z", end: "2000-01-01T00:00:03Z" }]);
    expect(stepAhead([...odd, ...STEPS], at("2000-01-01T00:00:02Z"))).toBe(at("2000-01-01T00:00:01.500Z"));
  });

  it("follow each other from wherever one is between them", () => {
    expect(stepBeside(STEPS, january, 1)).toBe(february);
    expect(stepBeside(STEPS, at("2000-01-30T00:00:00Z"), 1)).toBe(february);
    expect(stepBeside(STEPS, at("2000-01-30T00:00:00Z"), -1)).toBe(january);
    expect(stepBeside(STEPS, february, -1)).toBe(january);
    expect([stepBeside(STEPS, may, 1), stepBeside(STEPS, january, -1)]).toEqual([undefined, undefined]);
  });
});

describe("sums, which hold at the ends of steps", () => {
  const SUMS = parseSteps([JAN, FEB, MAY], "end");

  it("are gone to at their ends", () => {
    expect(stepBeside(SUMS, at(JAN.start), 1)).toBe(at(JAN.end));
    expect(stepBeside(SUMS, at(JAN.end), 1)).toBe(at(FEB.end));
    expect(stepBeside(SUMS, at(MAY.end), -1)).toBe(at(FEB.end));
    expect(stepAhead(SUMS, at("2000-01-20T00:00:00Z"))).toBe(at(JAN.end));
    expect(stepAhead(SUMS, at(MAY.end))).toBe(at(MAY.end));
  });

  it("are played to the last end, where the sum is whole, and then from the start", () => {
    expect(toIso(nextInstant(SUMS, at("2000-05-28T03:00:00Z"), 1))).toBe(MAY.end);
    expect(toIso(nextInstant(SUMS, at(MAY.end), 1))).toBe(JAN.start);
    expect(toIso(nextInstant(SUMS, at(MAY.end), 8))).toBe(JAN.start);
    expect(toIso(nextInstant(SUMS, at(MAY.start), 8))).toBe(MAY.end);
  });
});

describe("texts", () => {
  it("write instants in UTC", () => {
    expect(formatInstant(at("2000-07-04T05:06:00Z"))).toBe("4 Jul 2000, 05:06 UTC");
    expect(toIso(at("2000-07-04T05:06:07.900Z"))).toBe("2000-07-04T05:06:07Z");
  });

  it("name the same months each year where not every step has one", () => {
    const months = Array.from({ length: 24 }, (_, i) => {
      const [startMs, endMs] = [Date.UTC(2000, i), Date.UTC(2000, i + 1)];
      return { startMs, endMs, atMs: (startMs + endMs) / 2 };
    });
    expect([1, 2, 5, 7, 12, 33].map((least) => labelledEvery(least, months))).toEqual([1, 2, 6, 12, 12, 36]);
    const day = { startMs: 0, endMs: 86_400_000, atMs: 43_200_000 };
    expect([0, 5, 33].map((least) => labelledEvery(least, [day]))).toEqual([1, 5, 33]);
  });

  it("label a step by its length", () => {
    const step = (start: string, end: string): Step => parseSteps([month(start, end)])[0] as Step;
    expect(stepLabel(step("2000-02-01T00:00:00Z", "2000-03-01T00:00:00Z"))).toBe("Feb 2000");
    expect(stepLabel(step("2000-01-01T00:00:00Z", "2001-01-01T00:00:00Z"))).toBe("2000");
    expect(stepLabel(step("2002-01-05T00:00:00Z", "2002-01-06T00:00:00Z"))).toBe("5 Jan 2002");
    expect(stepLabel(step("2002-01-05T06:00:00Z", "2002-01-05T12:00:00Z"))).toBe("5 Jan 2002 06:00");
    expect(stepLabel(step("2000-01-16T00:00:00Z", "2000-02-16T00:00:00Z"))).toBe("Jan 2000");
  });

  it("label a step of more than a day, month or year by its first and last", () => {
    const label = (start: string, end: string) => stepLabel(parseSteps([month(`${start}T00:00:00Z`, `${end}T00:00:00Z`)])[0] as Step);
    expect(label("2000-09-01", "2000-12-01")).toBe("Sep–Nov 2000");
    expect(label("2000-12-01", "2001-03-01")).toBe("Dec 2000–Feb 2001");
    expect(label("2000-01-01", "2010-01-01")).toBe("2000–2009");
    expect(label("2002-01-05", "2002-01-13")).toBe("5–12 Jan 2002");
    expect(label("2002-01-29", "2002-02-06")).toBe("29 Jan–5 Feb 2002");
    expect(label("2001-12-27", "2002-01-04")).toBe("27 Dec 2001–3 Jan 2002");
    expect(label("1999-03-15", "2000-06-01")).toBe("15 Mar 1999–31 May 2000");
    expect(label("2000-01-01", "2001-03-01")).toBe("Jan 2000–Feb 2001");
    expect(label("2001-01-05", "2002-01-05")).toBe("2001");
  });
});

describe("an instant that there is nothing of", () => {
  it("is told with what there is and what is shown", () => {
    const text = outsideText("Flux", STEPS, at("1850-03-01T00:00:00Z"));
    expect(text).toBe(
      "“Flux” has nothing of 1 Mar 1850, 00:00 UTC: it covers 1 Jan 2000, 00:00 UTC to 1 Jun 2000, 00:00 UTC. " +
        "Shown is 1 Jan 2000, 00:00 UTC.",
    );
    expect(outsideText("Flux", STEPS, at("2026-11-21T00:00:00Z"))).toMatch(/Shown is 1 Jun 2000, 00:00 UTC\.$/);
  });

  it("lies beyond both ends and in no hole", () => {
    expect(["1999-12-31T23:59:59Z", "2000-06-01T00:00:01Z"].map((time) => isOutside(STEPS, at(time)))).toEqual([true, true]);
    expect([JAN.start, "2000-04-01T00:00:00Z", MAY.end].map((time) => isOutside(STEPS, at(time)))).toEqual([
      false,
      false,
      false,
    ]);
  });
});

describe("labels of a time axis", () => {
  const HOUR_S = 3600;
  const labels = (increment: number, ...times: string[]): string[] =>
    timeNames(undefined, times.map((time) => at(time) / 1000), 0, 0, increment);

  it("name years, months, days and hours, with what they lie in where that begins", () => {
    expect(labels(366 * 24 * HOUR_S, JAN.start)).toEqual(["2000"]);
    expect(labels(30 * 24 * HOUR_S, "1999-12-01T00:00:00Z", JAN.start, FEB.start)).toEqual([
      "Dec\n1999",
      "Jan\n2000",
      "Feb",
    ]);
    expect(labels(24 * HOUR_S, JAN.start, "2000-01-02T00:00:00Z")).toEqual(["1 Jan\n2000", "2 Jan"]);
    expect(labels(6 * HOUR_S, "2000-01-01T12:00:00Z", "2000-01-01T18:00:00Z", "2000-01-02T00:00:00Z")).toEqual([
      "12:00\n1 Jan 2000",
      "18:00",
      "00:00\n2 Jan 2000",
    ]);
  });
});

describe("time that runs with the screen", () => {
  it("goes on by parts of steps, whatever their length, and begins anew at the end", () => {
    expect(advanced(STEPS, 0.5, 0.25)).toEqual({ position: 0.75, timeMs: instantAt(STEPS, 0.75) });
    expect(advanced(STEPS, 2.9, 0.25)).toEqual({ position: 0, timeMs: at(JAN.start) });
    expect(advanced([], 0, 1)).toBeUndefined();
  });
});
