//! The plot of measurements: trusted values as a line with points, doubtful ones as points of another colour beside it.
import type uPlot from "uplot";
import { type Chart, dress, mount, padded } from "./chart";
import { type Group, isTrusted } from "./measured";

const TRUSTED = "#5fd4e8";
const UNCERTAINTYFUL = "#f2906b";

/** `unit` is shown at the axis. */
export function measuredChart(container: HTMLElement, group: Group, unit: string): Chart {
  const isOverTime = group.over === "time";
  const base = dress(unit);
  const [below, left] = base.axes ?? [];
  const dot = (stroke: string, size: number): uPlot.Series.Points => ({ show: true, size, fill: stroke, stroke });
  const options: Omit<uPlot.Options, "width" | "height"> = {
    ...base,
    scales: { x: { time: isOverTime }, y: { range: padded } },
    series: [
      {},
      // Gaps are where doubtful values are: the line goes on over them, as they are no measurement to trust.
      { stroke: TRUSTED, width: 1.5, spanGaps: true, points: dot(TRUSTED, 4) },
      { stroke: UNCERTAINTYFUL, width: 0, paths: () => null, points: dot(UNCERTAINTYFUL, 6) },
    ],
  };
  if (!isOverTime && below && left) {
    const { values: _timeNames, ...plain } = below;
    options.axes = [{ ...plain, label: "depth, m", labelSize: 18, size: 34 }, left];
  }
  const value = (wanted: boolean) =>
    group.points.map((point) => (isTrusted(point.quality) === wanted ? point.value : null));
  const data: uPlot.AlignedData = [
    group.points.map((point) => (isOverTime ? point.x / 1000 : point.x)),
    value(true),
    value(false),
  ];
  const { destroy } = mount(container, options, data);
  return { setNow: () => undefined, destroy };
}
