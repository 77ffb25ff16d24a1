//! Pure comma-separated text: an answer of the server in, a file with its provenance in comment lines out.
import type { Budget, PointSeries } from "../api/types";

export function seriesCsv(answer: PointSeries): string {
  // What sums hold stands beside them.
  const isCounted = answer.series.some((row) => row.contributed);
  const counted = isCounted ? ["contributed_steps", "contributed_of_steps", "contributed_time_percent"] : [];
  return lines(
    [
      `product: ${answer.product}`,
      `manifest: ${answer.manifest}`,
      `cell centre: lon ${answer.cell.lon_deg}, lat ${answer.cell.lat_deg}`,
      `unit: ${answer.unit}`,
    ],
    ["start", "end", "mid", "value", ...counted],
    answer.series.map(({ start, end, mid, value, contributed: held }) => [
      ...[start, end, mid, value],
      ...(isCounted ? [held?.steps ?? null, held?.of_steps ?? null, held?.time_percent ?? null] : []),
    ]),
  );
}

export function budgetCsv(answer: Budget): string {
  return lines(
    [
      `product: ${answer.product}`,
      `manifest: ${answer.manifest}`,
      `region: ${answer.region}`,
      `earth: ${answer.earth}`,
      `cells: ${answer.cells}`,
      `unit: ${answer.unit}`,
      `region area: ${answer.region_area_m2} m2, ocean ${answer.ocean_area_m2} m2 (${answer.ocean_source})`,
      `gap, no part of the budget: ${answer.gap_basis}`,
      ...answer.notes.map((note) => `note: ${note}`),
    ],
    ["start", "end", "budget_tg", "coverage_percent", "area_m2", "ocean_with_data_m2", "gap_tg", "gap_area_m2"],
    answer.rows.map((row) => [
      row.start,
      row.end,
      row.budget_tg,
      row.coverage_percent,
      row.area_m2,
      row.ocean_with_data_m2,
      row.gap_tg,
      row.gap_area_m2,
    ]),
  );
}

/** No data is an empty field. */
function lines(
  comments: readonly string[],
  header: readonly string[],
  rows: readonly (readonly (string | number | null)[])[],
): string {
  const text = [
    ...comments.map((comment) => `# ${comment}`),
    header.join(","),
    ...rows.map((row) => row.map((field) => field ?? "").join(",")),
  ];
  return `${text.join("\n")}\n`;
}
