"""Budgets, series and derivations on the compute cluster."""

from grafana_foundation_sdk.builders.dashboard import Dashboard

from panels import AMBER, GREEN, RED, dashboard, lines, number, quantiles

RATE = "service:fluxglobe_requests:rate5m"
TILES = "fluxglobe_tile_server"


def board() -> Dashboard:
    """The dashboard."""
    return (
        dashboard("fluxglobe-analysis", "Fluxglobe analysis", "Budgets, series and derivations on the compute cluster.")
        .with_panel(
            number(
                "Executors",
                "Executors that answer.",
                'sum(up{job="fluxglobe", service="executor"})',
                "none",
                (None, RED),
                (1, GREEN),
                width=6,
            )
        )
        .with_panel(
            number("Products", "Products that viewers can choose.", f"max({TILES}_products_count)", "none", width=6)
        )
        .with_panel(
            number(
                "Jobs under way", "Ballista jobs that run now.", "sum(fluxglobe_scheduler_in_flight)", "none", width=6
            )
        )
        .with_panel(
            number(
                "Analyses failing",
                "Share of budgets and series that fail.",
                f'sum({RATE}{{service="tile-server", operation!~"tile.*", outcome=~"failed|retryable"}}) / sum({RATE}{{service="tile-server", operation!~"tile.*"}})',
                "percentunit",
                (None, GREEN),
                (0.01, AMBER),
                (0.05, RED),
                width=6,
            )
        )
        .with_panel(
            lines(
                "Scheduler",
                "Jobs and calls by kind and outcome.",
                "ops",
                (
                    "sum by (operation, outcome) (rate(fluxglobe_scheduler_requests_total[$__rate_interval]))",
                    "{{operation}} {{outcome}}",
                ),
            )
        )
        .with_panel(
            lines(
                "Executors",
                "Tasks by outcome. `retryable` is a store or an executor that came and went.",
                "ops",
                (
                    "sum by (operation, outcome) (rate(fluxglobe_executor_requests_total[$__rate_interval]))",
                    "{{operation}} {{outcome}}",
                ),
            )
        )
        .with_panel(
            lines(
                "Job duration",
                "Median and 95th percentile.",
                "s",
                *quantiles("fluxglobe_scheduler_request_seconds", "{{operation}}", by="operation"),
            )
        )
        .with_panel(
            lines(
                "Task duration",
                "Median and 95th percentile.",
                "s",
                *quantiles("fluxglobe_executor_request_seconds", "{{operation}}", by="operation"),
            )
        )
    )
