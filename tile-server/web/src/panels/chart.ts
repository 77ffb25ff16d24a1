//! Plots: a series as a line with gaps and a cursor at the present instant, a budget as signed bars; uPlot draws, this dresses.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { timeNames } from "../time/steps";
import type { Sample } from "./series";

const INK = "#9fb6c6";
const GRID = "rgba(140, 180, 205, 0.14)";
const LINE = "#5fd4e8";
const NOW = "#ffd166";
const OUT = "#f2906b";
const IN = "#4aa8e0";
const FONT = "11px system-ui, -apple-system, 'Segoe UI', Roboto, 'Liberation Sans', sans-serif";
const HEIGHT_PX = 210;
/** Of more values dots lie over each other and hide the line. */
const MOST_DOTS = 60;

export interface TimeRange {
  readonly startMs: number;
  readonly endMs: number;
}

export interface Chart {
  /** Moves the cursor line; an instant outside of the plot is not drawn. */
  setNow(timeMs: number): void;
  destroy(): void;
}

/** `labelY` is the unit. The time axis spans `range`, so that the cursor is in sight at every instant. `onPick` gets the instant under a click. */
export function seriesChart(
  container: HTMLElement,
  samples: readonly Sample[],
  range: TimeRange,
  labelY: string,
  onPick: (timeMs: number) => void,
): Chart {
  let now = Number.NaN;
  const options: Omit<uPlot.Options, "width" | "height"> = {
    ...dress(labelY),
    scales: { x: { time: true, range: [range.startMs / 1000, range.endMs / 1000] }, y: { range: padded } },
    series: [
      {},
      {
        stroke: LINE,
        width: 2,
        spanGaps: false,
        points: {
          show: samples.length <= MOST_DOTS,
          // Between two gaps there is no line to see.
          filter: (_plot, _series, isShown) => (isShown ? null : lonelyOf(samples)),
          size: 6,
          fill: LINE,
          stroke: "#0b1f2f",
          width: 1,
        },
      },
    ],
    hooks: { drawAxes: [(plot) => zeroLine(plot)], draw: [(plot) => nowLine(plot, now)] },
  };
  const data: uPlot.AlignedData = [samples.map((sample) => sample.atMs / 1000), samples.map((sample) => sample.value)];
  const { plot, destroy } = mount(container, options, data);
  plot.over.addEventListener("click", (event) => onPick(plot.posToVal(event.offsetX, "x") * 1000));
  return {
    setNow(timeMs) {
      now = timeMs;
      plot.redraw(false, false);
    },
    destroy,
  };
}

/** One bar per row, warm for positive and cool for negative values. */
export function barChart(
  container: HTMLElement,
  rows: readonly { startMs: number; endMs: number; value: number }[],
  labelY: string,
): Chart {
  const centres = rows.map((row) => (row.startMs + row.endMs) / 2000);
  const paths = uPlot.paths.bars?.({ size: [0.72, 60], radius: 0.12 });
  const bars = (stroke: string): uPlot.Series => ({
    stroke,
    fill: `${stroke}cc`,
    width: 1,
    points: { show: false },
    ...(paths ? { paths } : {}),
  });
  const first = rows[0];
  const last = rows[rows.length - 1];
  const options: Omit<uPlot.Options, "width" | "height"> = {
    ...dress(labelY),
    series: [{}, bars(OUT), bars(IN)],
    hooks: { drawAxes: [(plot) => zeroLine(plot)] },
  };
  // Whole periods in sight: the outer bars are as wide as the others.
  if (first && last)
    options.scales = {
      x: { time: true, range: [first.startMs / 1000, last.endMs / 1000] },
      y: { range: paddedWithZero },
    };
  const data: uPlot.AlignedData = [
    centres,
    rows.map((row) => (row.value >= 0 ? row.value : null)),
    rows.map((row) => (row.value < 0 ? row.value : null)),
  ];
  const { destroy } = mount(container, options, data);
  return { setNow: () => undefined, destroy };
}

export function mount(
  container: HTMLElement,
  options: Omit<uPlot.Options, "width" | "height">,
  data: uPlot.AlignedData,
): { plot: uPlot; destroy: () => void } {
  const plot = new uPlot(
    { ...options, width: Math.max(200, container.clientWidth), height: HEIGHT_PX },
    data,
    container,
  );
  const watcher = new ResizeObserver(() => {
    if (container.clientWidth > 0) plot.setSize({ width: container.clientWidth, height: HEIGHT_PX });
  });
  watcher.observe(container);
  return {
    plot,
    destroy() {
      watcher.disconnect();
      plot.destroy();
    },
  };
}

export function dress(labelY: string): Omit<uPlot.Options, "width" | "height" | "series"> {
  const axis: uPlot.Axis = {
    stroke: INK,
    font: FONT,
    labelFont: FONT,
    grid: { stroke: GRID, width: 1 },
    ticks: { stroke: GRID, width: 1, size: 4 },
  };
  return {
    // The plot's dates are the product's, so they are read in UTC wherever the reader sits.
    tzDate: (seconds) => uPlot.tzDate(new Date(seconds * 1000), "Etc/UTC"),
    legend: { show: false },
    cursor: { y: false, drag: { x: false, y: false }, points: { size: 8 } },
    padding: [8, 20, 0, 0],
    axes: [
      { ...axis, grid: { show: false }, space: 44, size: 40, values: timeNames },
      {
        ...axis,
        label: labelY,
        labelSize: 20,
        labelGap: 2,
        size: 46,
        values: (_plot, splits) => splits.map((value) => String(Number(value.toPrecision(6))).replaceAll("-", "−")),
      },
    ],
  };
}

export function padded(_plot: uPlot, low: number | null, high: number | null): uPlot.Range.MinMax {
  if (low === null || high === null) return [0, 1];
  const pad = (high - low) * 0.08 || Math.abs(high) * 0.1 || 1;
  return [low - pad, high + pad];
}

function paddedWithZero(_plot: uPlot, low: number | null, high: number | null): uPlot.Range.MinMax {
  const bottom = Math.min(0, low ?? 0);
  const top = Math.max(0, high ?? 0);
  const pad = (top - bottom) * 0.06 || 1;
  return [bottom === 0 ? 0 : bottom - pad, top === 0 ? 0 : top + pad];
}

/** Which values have none beside them. */
export function lonelyOf(samples: readonly Sample[]): number[] {
  const isThere = (index: number): boolean => typeof samples[index]?.value === "number";
  return [...samples.keys()].filter((index) => isThere(index) && !isThere(index - 1) && !isThere(index + 1));
}

function zeroLine(plot: uPlot): void {
  const { min = 0, max = 0 } = plot.scales["y"] ?? {};
  if (min < 0 && max > 0) horizontal(plot, plot.valToPos(0, "y", true));
}

function horizontal(plot: uPlot, y: number): void {
  stroke(plot, "rgba(200, 225, 240, 0.45)", [4, 4], (context) => {
    context.moveTo(plot.bbox.left, y);
    context.lineTo(plot.bbox.left + plot.bbox.width, y);
  });
}

function nowLine(plot: uPlot, nowMs: number): void {
  const { min = 0, max = 0 } = plot.scales["x"] ?? {};
  const seconds = nowMs / 1000;
  if (!(seconds >= min && seconds <= max)) return;
  const x = plot.valToPos(seconds, "x", true);
  stroke(plot, NOW, [], (context) => {
    context.moveTo(x, plot.bbox.top);
    context.lineTo(x, plot.bbox.top + plot.bbox.height);
  });
}

function stroke(plot: uPlot, colour: string, dash: number[], path: (context: CanvasRenderingContext2D) => void): void {
  const { ctx } = plot;
  ctx.save();
  ctx.strokeStyle = colour;
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.setLineDash(dash.map((length) => length * devicePixelRatio));
  ctx.beginPath();
  path(ctx);
  ctx.stroke();
  ctx.restore();
}
