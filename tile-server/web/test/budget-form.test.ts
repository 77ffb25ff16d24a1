//! The budget's period while new steps land: what was chosen stays, and what went up to the newest step goes on to it.
import { afterEach, beforeEach, expect, it, vi } from "vitest";
import { BudgetForm } from "../src/panels/budget-form";
import { parseSteps, type Step } from "../src/time/steps";
import { paperDocument, type PaperElement } from "./paper-page";

beforeEach(() => void vi.stubGlobal("document", paperDocument()));
afterEach(() => void vi.unstubAllGlobals());

/** The months of a year, of which some are left out. */
function months(first: number, last: number, without: readonly number[] = []): Step[] {
  const at = (month: number) => new Date(Date.UTC(2000, month - 1, 1)).toISOString();
  const there = Array.from({ length: last - first + 1 }, (_, i) => first + i).filter((month) => !without.includes(month));
  return parseSteps(there.map((month) => ({ start: at(month), end: at(month + 1), mid: at(month) })));
}

function made(): { form: BudgetForm; period: () => string; choose: (from: number, to: number) => void } {
  const still = () => undefined;
  const form = new BudgetForm({ onChange: still, onRegion: still, drawBox: still, markRegion: still });
  const paper = form.element as unknown as PaperElement;
  const field = (id: string) => paper.find(id) ?? expect.unreachable(id);
  return {
    form,
    period: () => {
      const { from, to } = form.query("global") ?? expect.unreachable("no period");
      return `${from.slice(0, 7)} to ${to.slice(0, 7)}`;
    },
    choose: (from, to) => {
      field("from").value = String(from);
      field("to").value = String(to);
    },
  };
}

it("a period that was chosen stays when a step lands, wherever that is", () => {
  const { form, period, choose } = made();
  form.setSteps("flux", months(3, 8));
  expect(period()).toBe("2000-03 to 2000-09");
  choose(1, 3);
  expect(period()).toBe("2000-04 to 2000-07");
  form.setSteps("flux", months(3, 9));
  expect(period()).toBe("2000-04 to 2000-07");
  form.setSteps("flux", months(1, 9));
  expect(period()).toBe("2000-04 to 2000-07");
});

it("a period up to the newest step goes on to it", () => {
  const { form, period, choose } = made();
  form.setSteps("flux", months(1, 6));
  choose(3, 5);
  form.setSteps("flux", months(1, 7));
  expect(period()).toBe("2000-04 to 2000-08");
});

it("of a step that is gone the period begins and ends with those that are there", () => {
  const { form, period, choose } = made();
  form.setSteps("flux", months(1, 8));
  choose(1, 4);
  form.setSteps("flux", months(1, 8, [2, 5]));
  expect(period()).toBe("2000-03 to 2000-05");
});

it("another product begins with all that it has", () => {
  const { form, period, choose } = made();
  form.setSteps("flux", months(1, 8));
  choose(2, 3);
  form.setSteps("fluxes-of-others", months(1, 9));
  expect(period()).toBe("2000-01 to 2000-10");
  form.setSteps("flux", []);
  expect(form.query("global")).toBeUndefined();
});
