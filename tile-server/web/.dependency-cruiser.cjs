// Which file of the viewer may know which: no circles, and rooms that stand below others. `npm run check` holds it.
/** @type {import("dependency-cruiser").IConfiguration} */
module.exports = {
  forbidden: [
    {
      name: "no-circles",
      severity: "error",
      comment: "Two files that need each other are one file, or a third one is missing.",
      from: {},
      to: { circular: true },
    },
    {
      name: "api-stands-alone",
      severity: "error",
      comment: "What the server is asked does not depend on who asks.",
      from: { path: "^src/api/" },
      to: { path: "^src/(?!api/)" },
    },
    {
      name: "page-below-rooms",
      severity: "error",
      comment: "Elements and texts know no room that uses them.",
      from: { path: "^src/page/" },
      to: { path: "^src/(?!page/|api/)" },
    },
    {
      name: "panels-on-top",
      severity: "error",
      comment: "Panels use the other rooms and are joined to them by main.ts alone.",
      from: { path: "^src/(api|page|state|time|look|globe|stream|film)/" },
      to: { path: "^src/(panels/|[^/]+[.]ts$)" },
    },
    {
      name: "stream-over-globe",
      severity: "error",
      comment: "The globe does not know what lies over it.",
      from: { path: "^src/(api|page|state|time|look|globe)/" },
      to: { path: "^src/stream/" },
    },
    {
      name: "cesium-in-globe",
      severity: "error",
      comment: "One room knows the globe library.",
      from: { path: "^src/", pathNot: "^src/(globe/|main[.]ts$)" },
      to: { path: "node_modules/(cesium|@cesium)/" },
    },
    {
      name: "charts-in-panels",
      severity: "error",
      comment: "One room knows the chart library.",
      from: { path: "^src/", pathNot: "^src/panels/" },
      to: { path: "node_modules/uplot/" },
    },
    {
      name: "films-in-film",
      severity: "error",
      comment: "One room knows the film library, and nothing of the page.",
      from: { path: "^src/", pathNot: "^src/film/" },
      to: { path: "node_modules/mediabunny/" },
    },
    {
      name: "nothing-unresolved",
      severity: "error",
      comment: "A rule about a file that was not found holds nothing.",
      from: {},
      to: { couldNotResolve: true },
    },
  ],
  options: {
    // Types count: a circle of types is one too.
    tsPreCompilationDeps: true,
    tsConfig: { fileName: "tsconfig.json" },
    doNotFollow: { path: "node_modules" },
  },
};
