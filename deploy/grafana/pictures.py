"""Tiles and views: where they come from, what drawing takes, who is sent away."""

from grafana_foundation_sdk.builders.dashboard import Dashboard
from panels import AMBER, GREEN, RED, dashboard, lines, number, p95, quantiles, spread

TILES = "fluxglobe_tile_server"
WORKER = "fluxglobe_render_worker"

# What a picture goes through, in this order; storing is behind the answer.
STAGES = (
    ("look in the store", f"{TILES}_look_up_seconds", ""),
    ("wait for a turn", f"{TILES}_draw_wait_seconds", ""),
    ("wait at the worker", f"{WORKER}_wait_seconds", ""),
    ("load", f"{WORKER}_request_seconds", '{operation="load"}'),
    ("draw", f"{WORKER}_request_seconds", '{operation="draw"}'),
    ("encode", f"{WORKER}_request_seconds", '{operation="encode"}'),
    ("send", f"{TILES}_send_seconds", '{operation=~".*_png}"}'),
    ("store", f"{WORKER}_store_seconds", ""),
)


def board() -> Dashboard:
    """The dashboard."""
    hits = f"sum by (source) (rate({TILES}_cache_hits_total[$__rate_interval]))"
    misses = f"sum(rate({TILES}_cache_misses_total[$__rate_interval]))"
    return (
        dashboard("fluxglobe-pictures", "Fluxglobe pictures", "Where tiles and views come from and what drawing takes.")
        .with_panel(
            number(
                "Drawn anew",
                "Share of pictures that no cache had.",
                f"{misses} / (sum({hits}) + {misses})",
                "percentunit",
                width=6,
            )
        )
        .with_panel(
            number(
                "Drawing, 95 %",
                "The aims are 15 ms on a large GPU and 150 ms in software.",
                p95(f"{TILES}_draw_seconds", "15m"),
                "s",
                width=6,
            )
        )
        .with_panel(
            number(
                "Pictures waiting",
                "Pictures that viewers wait for, at all render workers.",
                'sum(fluxglobe_render_worker_queue_length{class="on_demand"})',
                "none",
                (None, GREEN),
                (32, AMBER),
                (128, RED),
                width=6,
            )
        )
        .with_panel(
            number(
                "Pictures that differ",
                "Two renderers drew different bytes for one job within a day. Worry above 0.",
                f'sum(increase({WORKER}_pictures_total{{origin="conflict"}}[24h])) or vector(0)',
                "none",
                (None, GREEN),
                (1, RED),
                width=6,
            )
        )
        .with_panel(
            lines(
                "Where pictures come from",
                "memory, store and client are caches; drawn is work.",
                "ops",
                (hits, "{{source}}"),
                (misses, "drawn"),
                stacked=True,
            )
        )
        .with_panel(
            lines(
                "Sent away",
                "Requests answered with 503 because too many waited. Worry when it lasts: start more render workers.",
                "ops",
                (f"rate({TILES}_refused_total[$__rate_interval])", "tile server {{instance}}"),
                (
                    'sum(rate(fluxglobe_render_worker_requests_total{outcome="busy"}[$__rate_interval]))',
                    "render workers",
                ),
            )
        )
        .with_panel(
            lines(
                "Drawing by mode",
                "Median and 95th percentile as the tile server sees it, waiting left out.",
                "s",
                *quantiles(f"{TILES}_draw_seconds", "{{mode}}", by="mode"),
            )
        )
        .with_panel(
            lines(
                "Waiting",
                "Median and 95th percentile of the time a picture waits for its turn.",
                "s",
                *quantiles(f"{TILES}_draw_wait_seconds", "wait"),
            )
        )
        .with_panel(
            lines(
                "Time by stage",
                "Seconds a second that all pictures together spend in each stage. Worry about the widest one first.",
                "none",
                *(
                    (f"sum(rate({metric}_sum{label}[$__rate_interval]))", name)
                    for name, metric, label in STAGES
                ),
                stacked=True,
            )
        )
        .with_panel(
            lines(
                "Queue by worker",
                "One long queue among short ones: a product that many ask for lives on that worker.",
                "none",
                ("sum by (instance, class) (fluxglobe_render_worker_queue_length)", "{{instance}} {{class}}"),
            )
        )
        .with_panel(
            lines(
                "Tries",
                "Pictures asked of single workers, by how that ended. More than one try a picture: workers are slow or away.",
                "ops",
                ("sum by (outcome) (rate(fluxglobe_render_fleet_tries_total[$__rate_interval]))", "{{outcome}}"),
                stacked=True,
            )
        )
        .with_panel(
            lines(
                "Render workers",
                "As the tile servers see them.",
                "none",
                ("max by (health) (fluxglobe_render_fleet_workers)", "{{health}}"),
            )
        )
        .with_panel(
            lines(
                "Fields kept",
                "Bytes of fields by where they are; a full memory means fields are read again and again.",
                "bytes",
                ("sum by (instance, place) (fluxglobe_render_worker_resident_bytes)", "{{instance}} {{place}}"),
            )
        )
        .with_panel(spread("Spread of drawing", "Time to draw a picture.", f"{TILES}_draw_seconds"))
    )
