//! What the server answers and takes, by the names that the page uses: all of it generated from the server's own description.
import type { components, operations } from "./schema";

type Schemas = components["schemas"];

export type Mode = Schemas["Mode"];
export type Legend = Schemas["Legend"];
export type Palette = Schemas["PaletteColours"];
export type Product = Schemas["Product"];
export type TileJson = Schemas["TileJson"];
export type StepTimes = Schemas["StepTimes"];
/** The series of a cell; statistics, which the same address gives, are not asked for. */
export type PointSeries = Extract<Answer<"point">, { series: unknown }>;
/** The means of a region; statistics, which the same address gives, are not asked for. */
export type RegionMeans = Extract<Answer<"area">, { series: unknown }>;
/** What a sum holds, at a place. */
export type CellCounts = Schemas["CellCounts"];
export type Quantity = Schemas["Quantity"];
/** A code of a mask and what it means. */
export type Flag = Schemas["Flag"];
export type Cells = Schemas["Cells"];
export type Earth = Schemas["Earth"];
export type Budget = Schemas["BudgetAnswer"];
export type BudgetRow = Schemas["BudgetRow"];
export type TimeStep = Schemas["TimeStep"];
export type Region = Schemas["Region"];
export type Check = Schemas["Check"];
export type CheckRow = Schemas["CheckRow"];
export type CheckPaper = Schemas["AgainstPaper"];
export type News = Schemas["News"];
export type Refusal = Schemas["Refusal"];
export type Kind = Schemas["PlatformKind"];
export type Quality = Schemas["Quality"];
export type Platform = Schemas["PlatformFeature"];
export type Observation = Schemas["Observation"];
export type ObservationPage = Schemas["ObservationPage"];

/** Parameters that an operation takes after the question mark. */
export type Query<Name extends keyof operations> = NonNullable<operations[Name]["parameters"]["query"]>;
/** The same as an address has them. */
export type QueryTexts<Name extends keyof operations> = { [Parameter in keyof Query<Name>]?: string };

/** What an operation answers as JSON. */
export type Answer<Name extends keyof operations> = operations[Name]["responses"] extends {
  200: { content: { "application/json": infer Body } };
}
  ? Body
  : never;

/** What a budget is asked for with; the newest version answers. */
export type BudgetQuery = Required<Pick<Query<"budget">, "region" | "from" | "to" | "step" | "earth" | "cells">>;
