"""One service: rate, errors and duration of each of its operations."""

from grafana_foundation_sdk.builders.dashboard import Dashboard
from panels import FULL, dashboard, lines, quantiles, service_variable, spread


def board() -> Dashboard:
    """The dashboard."""
    requests = "fluxglobe_${service}_requests_total"
    seconds = "fluxglobe_${service}_request_seconds"
    return (
        dashboard(
            "fluxglobe-service", "Fluxglobe service", "Rate, errors and duration of each operation of one service."
        )
        .with_variable(service_variable())
        .with_panel(
            lines(
                "Rate",
                "Operations that ended, by kind.",
                "ops",
                (f"sum by (operation) (rate({requests}[$__rate_interval]))", "{{operation}}"),
            )
        )
        .with_panel(
            lines(
                "Outcomes",
                "How they ended: ok; refused (what was asked for cannot be); busy (sent away); retryable and failed (errors); dropped (nobody waited any more).",
                "ops",
                (f"sum by (outcome) (rate({requests}[$__rate_interval]))", "{{outcome}}"),
                stacked=True,
            )
        )
        .with_panel(
            lines(
                "Duration",
                "Median and 95th percentile, by operation.",
                "s",
                *quantiles(seconds, "{{operation}}", by="operation"),
            )
        )
        .with_panel(
            lines(
                "Under way",
                "Operations that have begun and not ended. Worry when it only grows.",
                "none",
                ("sum by (operation) (fluxglobe_${service}_in_flight)", "{{operation}}"),
            )
        )
        .with_panel(
            spread(
                "Spread of durations",
                "Every operation of the service; two bands mean two kinds of work.",
                seconds,
                width=FULL,
            )
        )
    )
