//! The check table: what is said of printed numbers with and without an uncertainty.
import { describe, expect, it } from "vitest";
import type { CheckPaper, CheckRow } from "../src/api/types";
import { statedText, verdictText } from "../src/panels/check";

const stated = { value: -1.4, uncertainty: 0.7, decimals: 1 };
const paper: CheckPaper = { stated, difference: -0.0043, verdict: "within" };
const row: CheckRow = {
  what: "Global ocean",
  period: "2000",
  unit: "Pg C",
  paper,
  independent: -1.404272,
  ours: -1.404271,
  difference: 1e-6,
  agrees: true,
};

describe("a printed number", () => {
  it("keeps its decimals and its uncertainty", () => {
    expect(statedText(paper)).toBe("−1.4 ± 0.7");
    expect(statedText({ ...paper, stated: { value: -0.7, uncertainty: null, decimals: 2 } })).toBe("−0.70");
    expect(statedText(null)).toBe("–");
  });

  it("holds ours within its own uncertainty or says that it states none", () => {
    expect(verdictText(row)).toBe("within (−0.004)");
    const unsaid = { ...stated, uncertainty: null };
    const band: CheckPaper = { stated: unsaid, difference: 0.006, verdict: "no_uncertainty_stated" };
    expect(verdictText({ ...row, paper: band })).toBe("no uncertainty stated (+0.006)");
    expect(verdictText({ ...row, paper: null })).toBe("");
    expect(verdictText({ ...row, paper: null, agrees: false })).toBe("off the independent number");
  });
});
