"""Budgets, series and derivations on the compute cluster."""

from grafana_foundation_sdk.builders.dashboard import Dashboard
from panels import AMBER, GREEN, RED, dashboard, lines, number, quantiles

# What the tile server is asked for besides pictures and by programs.
ASKED = 'service="tile-server", operation=~"/api/products/.*"'
RATE = "service:fluxglobe_requests:rate5m"
TILES = "fluxglobe_tile_server"


def board() -> Dashboard:
    """The dashboard."""
    failing = f'sum({RATE}{{{ASKED}, outcome=~"failed|busy"}})'
    board = dashboard(
        "fluxglobe-analysis", "Fluxglobe analysis", "Budgets, series and derivations on the compute cluster."
    )
    numbers = [
        number(
            "Executors",
            "Executors that the scheduler knows. Worry at 0.",
            "max(fluxglobe_scheduler_executors)",
            "none",
            (None, RED),
            (1, GREEN),
            width=6,
        ),
        number("Products", "Products that viewers can choose.", f"max({TILES}_products_count)", "none", width=6),
        number(
            "Tasks waiting",
            "Tasks that no executor has taken yet. Worry when it lasts: start more executors.",
            "sum(fluxglobe_scheduler_waiting_tasks)",
            "none",
            width=6,
        ),
        number(
            "Questions failing",
            "Share of budgets and series, asked over HTTP, that get no answer.",
            f"{failing} / sum({RATE}{{{ASKED}}})",
            "percentunit",
            (None, GREEN),
            (0.01, AMBER),
            (0.05, RED),
            width=6,
        ),
    ]
    for panel in numbers:
        board = board.with_panel(panel)
    return (
        board.with_panel(
            lines(
                "Queries",
                "Queries on the cluster that ended, by how. `dropped` was cancelled.",
                "ops",
                ("sum by (outcome) (rate(fluxglobe_scheduler_requests_total[$__rate_interval]))", "{{outcome}}"),
                stacked=True,
            )
        )
        .with_panel(
            lines(
                "Query duration",
                "From submission to end.",
                "s",
                *quantiles("fluxglobe_scheduler_request_seconds", "query"),
            )
        )
        .with_panel(
            lines(
                "Derivations",
                "Products redone because of what landed, by how that ended.",
                "ops",
                (
                    "sum by (operation, outcome) (rate(fluxglobe_deriver_requests_total[$__rate_interval]))",
                    "{{operation}} {{outcome}}",
                ),
                stacked=True,
            )
        )
        .with_panel(
            lines(
                "Derivation duration",
                "From a landed granule to the derived product.",
                "s",
                *quantiles("fluxglobe_deriver_request_seconds", "{{operation}}", by="operation"),
            )
        )
        .with_panel(
            lines(
                "Tasks",
                "Tasks that ended, by how. `retryable` is a store or another executor that was away.",
                "ops",
                ("sum by (outcome) (rate(fluxglobe_executor_requests_total[$__rate_interval]))", "{{outcome}}"),
                stacked=True,
            )
        )
        .with_panel(
            lines(
                "Task duration",
                "At all executors.",
                "s",
                *quantiles("fluxglobe_executor_request_seconds", "task"),
            )
        )
        .with_panel(
            lines(
                "Tasks by executor",
                "Tasks that ended. One that stands still among others is stuck.",
                "ops",
                ("sum by (instance) (rate(fluxglobe_executor_requests_total[$__rate_interval]))", "{{instance}}"),
            )
        )
        .with_panel(
            lines(
                "Intermediate results",
                "Bytes in each executor's work folder.",
                "bytes",
                ("fluxglobe_executor_work_bytes", "{{instance}}"),
            )
        )
        .with_panel(
            lines(
                "Questions",
                "Budgets and series asked over HTTP, by route.",
                "ops",
                (f"sum by (operation) ({RATE}{{{ASKED}}})", "{{operation}}"),
            )
        )
        .with_panel(
            lines(
                "Duration of questions",
                "95 % are answered sooner, by route.",
                "s",
                (f"service:fluxglobe_request_seconds:p95_5m{{{ASKED}}}", "{{operation}}"),
            )
        )
    )
