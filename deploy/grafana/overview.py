"""The first dashboard to look at: is all well, and if not, where?"""

from grafana_foundation_sdk.builders.dashboard import Dashboard
from panels import AMBER, GREEN, RED, dashboard, lines, number, p95, quantiles, row

UP = 'up{job="fluxglobe"}'
LANDED = "fluxglobe_ingestd_notice_to_landed_seconds"
FRESH = "fluxglobe_tile_server_notice_to_tile_seconds"
RATE = "service:fluxglobe_requests:rate5m"


def board() -> Dashboard:
    """The dashboard."""
    board = dashboard("fluxglobe-overview", "Fluxglobe overview", "Is all well, and if not, where?")
    numbers = [
        number(
            "Alerts",
            "Alerts that fire now. Worry above 0.",
            'count(ALERTS{alertstate="firing", alertname=~"Fluxglobe.*"}) or vector(0)',
            "none",
            (None, GREEN),
            (1, RED),
        ),
        number(
            "Processes away",
            "Processes that Prometheus knows and that do not answer. Worry above 0.",
            f"count({UP} == 0) or vector(0)",
            "none",
            (None, GREEN),
            (1, RED),
        ),
        number(
            "Notice to tile",
            "95 % of fresh tiles came sooner than this after their notice, in the last hour. Worry above two minutes.",
            p95(FRESH, "1h"),
            "s",
            (None, GREEN),
            (60, AMBER),
            (120, RED),
        ),
        number(
            "Notices waiting",
            "Notices that ingest has not finished. Worry when it grows.",
            "max(fluxglobe_ingestd_lag_messages)",
            "none",
            (None, GREEN),
            (100, AMBER),
            (1000, RED),
        ),
        number(
            "Refused in 24 h",
            "Notices refused within a day; `fluxglobe rejected list` says why.",
            "sum(increase(fluxglobe_ingestd_rejected_total[24h])) or vector(0)",
            "none",
            (None, GREEN),
            (1, AMBER),
        ),
        number(
            "Errors",
            "The worst service's share of operations that failed. Worry above 5 %.",
            "max(service:fluxglobe_errors:ratio_rate5m) or vector(0)",
            "percentunit",
            (None, GREEN),
            (0.01, AMBER),
            (0.05, RED),
        ),
    ]
    for panel in numbers:
        board = board.with_panel(panel)
    return (
        board.with_row(row("Freshness"))
        .with_panel(
            lines(
                "Notice to landed",
                "Time from a granule's notice until it is stored. Worry above a minute.",
                "s",
                *quantiles(LANDED, "landed", window="15m"),
            )
        )
        .with_panel(
            lines(
                "Notice to tile",
                "From a notice to a tile that shows what it brought, asked for or ordered ahead. Worry above two minutes.",
                "s",
                *quantiles(FRESH, "{{path}}", by="path", window="15m"),
            )
        )
        .with_panel(
            lines(
                "Notices waiting",
                "Notices that no ingest process has finished. Worry when the number only grows.",
                "none",
                ("max(fluxglobe_ingestd_lag_messages)", "waiting"),
            )
        )
        .with_panel(
            lines(
                "Notices",
                "What became of them. `refused` ends in granule.rejected, `retryable` is tried again.",
                "ops",
                (
                    'sum by (outcome) (rate(fluxglobe_ingestd_requests_total{operation="notice"}[$__rate_interval]))',
                    "{{outcome}}",
                ),
                stacked=True,
            )
        )
        .with_row(row("Services"))
        .with_panel(
            lines(
                "Rate",
                "Operations that ended, by service.",
                "ops",
                (f"sum by (service) ({RATE})", "{{service}}"),
                width=8,
            )
        )
        .with_panel(
            lines(
                "Errors",
                "Share of operations that failed. Worry above 5 %.",
                "percentunit",
                ("service:fluxglobe_errors:ratio_rate5m", "{{service}}"),
                width=8,
            )
        )
        .with_panel(
            lines(
                "Duration",
                "95 % of operations took less than this; the slowest operation of each service.",
                "s",
                ("max by (service) (service:fluxglobe_request_seconds:p95_5m)", "{{service}}"),
                width=8,
            )
        )
        .with_row(row("Processes"))
        .with_panel(
            lines(
                "Alive",
                "Processes that answer, by service.",
                "none",
                (f"sum by (service) ({UP})", "{{service}}"),
                width=6,
            )
        )
        .with_panel(
            lines(
                "Memory",
                "Resident memory of the largest process of each service.",
                "bytes",
                ('max by (service) (process_resident_memory_bytes{job="fluxglobe"})', "{{service}}"),
                width=6,
            )
        )
        .with_panel(
            lines(
                "Processor",
                "Cores in use, by service.",
                "none",
                (
                    'sum by (service) (rate(process_cpu_seconds_total{job="fluxglobe"}[$__rate_interval]))',
                    "{{service}}",
                ),
                width=6,
            )
        )
        .with_panel(
            lines(
                "Open files",
                "Share of the limit, of the fullest process. Worry above 80 %.",
                "percentunit",
                (
                    'max by (service) (process_open_fds{job="fluxglobe"} / process_max_fds{job="fluxglobe"})',
                    "{{service}}",
                ),
                width=6,
            )
        )
    )
