"""Statistics of every cell in a polygon over many years: `fluxglobe derive statistic` beside xarray with flox, and pymannkendall.

Of some 46,000 cells of the made-up China Sea (`fluxglobe generate china-sea --years N`, 450 x 615 cells a day): the monthly
climatology, the anomaly of every day, and the trend of every cell (Theil-Sen through means of months, seasons taken off) with its
significance (Mann-Kendall, variance after Hamed and Rao 1998). Both sides read what they have landed, in the peer's layout by time, and store
what they find. The peer's trends are worked out cell by cell on all processors; of some cells, and the time of all is reckoned
from theirs. All four are compared before any figure is told.

    make bench ARGS="maps --data FOLDER"      # the folder of `stats --data` may be used again
    make bench ARGS="maps --years 6"
"""

import argparse
import json
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import stats
import tiles

NAME = "bench-maps"
STATISTICS = ["climatology", "anomaly", "trend", "trend-p-value"]
# Cells whose trends the peer works out, and how far apart answers may be, as a share of the largest.
TREND_CELLS = 400
TOLERANCE = 2e-5
# Steps of which anomalies are compared.
STEPS = 40
YEAR_DAYS = 365.25


def main():
    options = arguments()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        folder = Path(options.data or folder)
        folder.mkdir(parents=True, exist_ok=True)
        product, _builds = stats.data(options, folder)
        peer = stats.Peer(folder, options)
        ring = stats.outline(0.007)
        ours, own_s = fluxglobe(options, folder, product, ring)
        theirs, parts = xarray(options, folder, peer, ring)
        worst = compared(ours, theirs)
        print_table(options, own_s, parts, theirs, worst)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True, help="the fluxglobe to measure")
    parser.add_argument("--years", type=int, default=16, help="years of days")
    parser.add_argument("--folder", help="where temporary files are made")
    parser.add_argument("--data", help="folder that keeps what was made and landed, for another run")
    parser.add_argument("--json", action="store_true", help="figures as JSON")
    return parser.parse_args()


def fluxglobe(options, folder, product, ring):
    """Derives all four with one command; gives the products as they are exported, and seconds."""
    import xarray as xr

    tiles.say("fluxglobe: climatology, anomaly, trend and its significance")
    text = "POLYGON((" + ",".join(f"{x} {y}" for x, y in [*ring, ring[0]]) + "))"
    # A name that no run before has taken: what is there already is not derived again.
    name = f"{NAME}-{int(time.time())}"
    words = ["--product", product, "--region", text, "--statistic", ",".join(STATISTICS), "--name", name, "--least-percent", 0]
    begin = time.perf_counter()
    tiles.run(options.program, "--data", folder / "data", "derive", "statistic", *words)
    seconds = time.perf_counter() - begin
    found = {}
    for statistic in STATISTICS:
        target = folder / f"{name}-{statistic}.zarr"
        span = ["--from", "2009", "--to", "2009-03"] if statistic == "anomaly" else []
        tiles.run(options.program, "--data", folder / "data", "export", f"{name}-{statistic}", "--to", "zarr", target)
        found[statistic] = xr.open_zarr(target)
    return found, seconds


def xarray(options, folder, peer, ring):
    """The same with the peers: what they find, and seconds of each part."""
    import dask
    import flox  # noqa: F401 - xarray groups with it
    import numpy as np
    import xarray as xr

    tiles.say("xarray and flox: climatology and anomaly")
    rows, cols, weights, cells = stats.polygon_weights(peer, ring)
    inside = xr.DataArray(weights > 0, dims=("lat", "lon"))
    xr.set_options(use_flox=True)
    parts = {}
    begin = time.perf_counter()
    window = xr.open_zarr(folder / "times.zarr")["flux"][:, rows, cols]
    window = window.where(inside.assign_coords(lat=window["lat"], lon=window["lon"]))
    months = window.groupby("time.month")
    climatology = months.mean()
    anomaly = months - climatology
    out = folder / "peer-maps.zarr"
    stored = xr.Dataset({"climatology": climatology, "anomaly": anomaly.astype("float32")})
    stored = stored.drop_vars("month", errors="ignore") if "month" in anomaly.coords and "month" not in climatology.dims else stored
    stored["anomaly"] = stored["anomaly"].chunk({"time": 128, "lat": -1, "lon": -1})
    encoding = {"anomaly": {"chunks": (128, window.sizes["lat"], window.sizes["lon"])}}
    for name in stored.variables:
        stored[name].encoding.pop("chunks", None)
    stored.to_zarr(out, mode="w", encoding=encoding)
    parts["climatology and anomaly"] = time.perf_counter() - begin

    tiles.say("pymannkendall: trends")
    begin = time.perf_counter()
    means = window.resample(time="MS").mean().compute()
    off = (means.groupby("time.month") - means.groupby("time.month").mean()).values
    parts["means of months"] = time.perf_counter() - begin
    edges = np.append(means["time"].values, means["time"].values[-1] + np.timedelta64(31, "D")).astype("datetime64[M]").astype("datetime64[ms]")
    middles = edges[:-1] + (edges[1:] - edges[:-1]) / 2
    years = (middles - middles[0]).astype("float64") / 86_400_000 / YEAR_DAYS
    places = np.argwhere((weights > 0) & ~np.isnan(off).any(axis=0))
    places = places[:: max(len(places) // TREND_CELLS, 1)][:TREND_CELLS]
    series = [off[:, row, col] for row, col in places]
    workers = os.cpu_count()
    with ProcessPoolExecutor(workers) as pool:
        # Whoever is started imports first; that is not timed.
        list(pool.map(trend_of, [(series[0], years)] * workers * 2))
        begin = time.perf_counter()
        trends = list(pool.map(trend_of, [(one, years) for one in series], chunksize=20))
        taken = time.perf_counter() - begin
    parts[f"trends of all cells, reckoned from {len(series)}"] = taken * cells / len(series)
    dask.config.set(scheduler="threads")
    lat, lon = window["lat"].values, window["lon"].values
    return {
        "climatology": climatology,
        "anomaly": anomaly,
        "trend": [(lat[row], lon[col], *found) for (row, col), found in zip(places, trends)],
        "cells": cells,
    }, parts


def trend_of(asked):
    """Slope a year and p value of a series."""
    import pymannkendall
    from scipy.stats import theilslopes

    values, years = asked
    test = pymannkendall.hamed_rao_modification_test(values)
    return theilslopes(values, years)[0], test.p, test.var_s


def compared(ours, theirs):
    """How far answers are apart, as a share of the largest; the program ends where that is much."""
    import numpy as np

    worst = {}

    def check(name, own, other):
        own, other = np.asarray(own, "float64"), np.asarray(other, "float64")
        if own.shape != other.shape or (np.isnan(own) != np.isnan(other)).any():
            sys.exit(f"{name}: shapes {own.shape}, {other.shape}, or gaps at other places")
        worst[name] = float(np.nanmax(np.abs(own - other)) / np.nanmax(np.abs(other)))
        if worst[name] > TOLERANCE:
            sys.exit(f"{name}: answers differ by {worst[name]:.2e} of the largest")

    def variable(statistic):
        cube = ours[statistic]
        return cube[next(name for name, array in cube.data_vars.items() if array.ndim == 3)]

    climatology = theirs["climatology"].compute()
    at = {"lat": climatology["lat"].values, "lon": climatology["lon"].values}
    pick = lambda array: array.sel(latitude=at["lat"], longitude=at["lon"], method="nearest") if "latitude" in array.dims else array.sel(**at, method="nearest")
    # Stored fluxes are kg of carbon m-2 s-1, anomalies and trends g of it m-2 a year; the files hold mmol of CO2 m-2 d-1.
    to_kg = 12.011e-6 / 86_400
    check("climatology", pick(variable("climatology")).values, climatology.values * to_kg)
    own = pick(variable("anomaly")).isel(time=slice(0, STEPS))
    other = theirs["anomaly"].sel(time=own["time"].values, method="nearest").compute()
    check("anomaly", own.values, other.values * stats.GRAMS_A_YEAR)
    lat = [row[0] for row in theirs["trend"]]
    lon = [row[1] for row in theirs["trend"]]

    def cells(statistic):
        array = variable(statistic).isel(time=0)
        names = ("latitude", "longitude") if "latitude" in array.dims else ("lat", "lon")
        return np.array([float(array.sel({names[0]: y, names[1]: x}, method="nearest")) for y, x in zip(lat, lon)])

    check("trend", cells("trend"), np.array([row[2] for row in theirs["trend"]]) * stats.GRAMS_A_YEAR)
    own, other = cells("trend-p-value"), np.array([row[3] for row in theirs["trend"]])
    # Ours never takes autocorrelation for a reason to be surer: p values that the peer makes smaller stay larger with us.
    apart = np.abs(own - other)
    surer = own > other + 1e-6
    worst["p value, where the peer's variance is not made smaller"] = float(apart[~surer].max(initial=0.0))
    worst["p value, cells where it is"] = int(surer.sum())
    if worst["p value, where the peer's variance is not made smaller"] > 1e-4:
        sys.exit(f"p values differ by {apart[~surer].max():.2e}")
    return worst


def print_table(options, own_s, parts, theirs, worst):
    all_of_them = sum(parts.values())
    if options.json:
        print(json.dumps({"ours_s": own_s, "peer_s": parts, "cells": theirs["cells"], "differ": worst}, indent=1))
        return
    print(f"{os.cpu_count()} processors, {options.years} years of days, {theirs['cells']} cells of a polygon")
    print(f"  fluxglobe derive statistic, all four, landed        {own_s:10.1f} s")
    for name, seconds in parts.items():
        print(f"  peer: {name:<46}{seconds:10.1f} s")
    print(f"  peer: all                                           {all_of_them:10.1f} s   {all_of_them / own_s:.1f} x")
    for name, value in worst.items():
        print(f"  {name}: {value:.1e}" if isinstance(value, float) else f"  {name}: {value}")


if __name__ == "__main__":
    main()
