"""The few kinds of panels that our dashboards are made of, on top of Grafana's own builders."""

from grafana_foundation_sdk.builders.common import (
    ReduceDataOptions,
    StackingConfig,
    VizLegendOptions,
    VizTooltipOptions,
)
from grafana_foundation_sdk.builders.dashboard import (
    CustomVariable,
    Dashboard,
    DatasourceVariable,
    Row,
    ThresholdsConfig,
)
from grafana_foundation_sdk.builders.heatmap import Panel as HeatmapPanel
from grafana_foundation_sdk.builders.prometheus import Dataquery
from grafana_foundation_sdk.builders.stat import Panel as StatPanel
from grafana_foundation_sdk.builders.timeseries import Panel as TimeseriesPanel
from grafana_foundation_sdk.models.common import (
    BigValueColorMode,
    LegendDisplayMode,
    LegendPlacement,
    SortOrder,
    StackingMode,
    TooltipDisplayMode,
)
from grafana_foundation_sdk.models.dashboard import (
    DataSourceRef,
    Threshold,
    ThresholdsMode,
    VariableHide,
)
from grafana_foundation_sdk.models.prometheus import PromQueryFormat

SOURCE = DataSourceRef(type_val="prometheus", uid="${datasource}")
# Columns of Grafana's grid.
FULL = 24
GREEN, AMBER, RED = "green", "orange", "red"


def dashboard(uid: str, title: str, description: str) -> Dashboard:
    """An empty dashboard with the choice of a data source; the last six hours, read again every 30 s."""
    return (
        Dashboard(title)
        .uid(uid)
        .description(description)
        .tags(["fluxglobe"])
        .timezone("utc")
        .refresh("30s")
        .time("now-6h", "now")
        .editable()
        .with_variable(DatasourceVariable("datasource").label("Data source").type("prometheus").regex(""))
    )


def service_variable() -> CustomVariable:
    """The service a panel speaks of, as metrics spell it."""
    names = [
        "ingestd",
        "observations",
        "scheduler",
        "deriver",
        "executor",
        "render_worker",
        "render_fleet",
        "tile_server",
    ]
    return CustomVariable("service").label("Service").values(",".join(names)).hide(VariableHide.DONT_HIDE)


def row(title: str) -> Row:
    """A heading."""
    return Row(title)


def query(expr: str, legend: str = "", *, ref: str = "A", instant: bool = False) -> Dataquery:
    """One PromQL expression."""
    built = Dataquery().datasource(SOURCE).ref_id(ref).expr(expr).legend_format(legend)
    return built.instant() if instant else built.range()


def thresholds(*steps: tuple[float | None, str]) -> ThresholdsConfig:
    """Colours from a value on; the first step has no value."""
    return ThresholdsConfig().mode(ThresholdsMode.ABSOLUTE).steps([Threshold(value=v, color=c) for v, c in steps])


def number(
    title: str, what: str, expr: str, unit: str, *colours: tuple[float | None, str], width: int = 4
) -> StatPanel:
    """One figure, now."""
    return (
        StatPanel()
        .title(title)
        .description(what)
        .datasource(SOURCE)
        .unit(unit)
        .thresholds(thresholds(*(colours or ((None, GREEN),))))
        .color_mode(BigValueColorMode.BACKGROUND if colours else BigValueColorMode.VALUE)
        .reduce_options(ReduceDataOptions().calcs(["lastNotNull"]))
        .no_value("none")
        .with_target(query(expr, instant=True))
        .span(width)
        .height(4)
    )


def lines(
    title: str, what: str, unit: str, *queries: tuple[str, str], width: int = 12, stacked: bool = False
) -> TimeseriesPanel:
    """Lines over time; each query is an expression and the name of its lines."""
    panel = (
        TimeseriesPanel()
        .title(title)
        .description(what)
        .datasource(SOURCE)
        .unit(unit)
        .min(0)
        .fill_opacity(40 if stacked else 8)
        .legend(
            VizLegendOptions()
            .show_legend(True)
            .display_mode(LegendDisplayMode.TABLE)
            .placement(LegendPlacement.BOTTOM)
            .calcs(["lastNotNull", "max"])
        )
        .tooltip(VizTooltipOptions().mode(TooltipDisplayMode.MULTI).sort(SortOrder.DESCENDING))
        .span(width)
        .height(8)
    )
    if stacked:
        panel = panel.stacking(StackingConfig().mode(StackingMode.NORMAL))
    for index, (expr, legend) in enumerate(queries):
        panel = panel.with_target(query(expr, legend, ref=chr(ord("A") + index)))
    return panel


def spread(title: str, what: str, histogram: str, *, width: int = 12) -> HeatmapPanel:
    """How a histogram's observations are spread, over time. `histogram`: its name."""
    return (
        HeatmapPanel()
        .title(title)
        .description(what)
        .datasource(SOURCE)
        .calculate(False)
        .with_target(
            query(f"sum by (le) (increase({histogram}_bucket[$__rate_interval]))", "{{le}}").format(
                PromQueryFormat.HEATMAP
            )
        )
        .span(width)
        .height(8)
    )


def quantiles(histogram: str, legend: str, *, by: str = "", window: str = "$__rate_interval") -> list[tuple[str, str]]:
    """Median and 95th percentile of a histogram, apart by a label."""
    groups = f"{by}, le" if by else "le"
    return [
        (f"histogram_quantile({q}, sum by ({groups}) (rate({histogram}_bucket[{window}])))", f"{legend} {label}")
        for q, label in ((0.5, "median"), (0.95, "95 %"))
    ]


def p95(histogram: str, window: str) -> str:
    """The 95th percentile of a histogram over a window."""
    return f"histogram_quantile(0.95, sum by (le) (rate({histogram}_bucket[{window}])))"
