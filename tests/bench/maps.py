"""Statistics of every cell in a polygon over many years: `fluxglobe derive statistic` beside xarray with flox, and pymannkendall.

Of some 46,000 cells of the made-up China Sea (`fluxglobe generate china-sea --years N`, 450 x 615 cells a day): the monthly
climatology, the anomaly of every day and of every month, and the trend of every cell with its significance: Theil and Sen's slope through means of
months, seasons taken off, with Mann and Kendall's test (variance after Hamed and Rao 1998, by what ranks keep from month to month), and least squares with an effective
number of values (Santer et al. 2000). Both sides read what they have landed, files in the page cache, and store what they find:
ours as products (fields, a cube in both layouts, levels) of the cells about the polygon (`--crop`), the peer as Zarr of the same box in its
layout by time, which is its quickest for all of this. Anomalies of every day are also stored on all cells of the grid, as they are without `--crop`. Its least squares are worked out over all cells at once by NumPy; Mann and Kendall's test is pymannkendall's, cell by cell on
all processors, of some cells, and the time of all is reckoned from theirs. All are compared before any figure is told.

pymannkendall closes gaps: months on both sides of one are next to each other. With us a lag is a lag in time, so slopes and p values
are compared with scipy's slope and the formula of Hamed and Rao over months in their places, of means in 64 bits (the peer's are of
32). The formula takes the autocorrelation from month to month and its powers (Yue and Wang 2004), where pymannkendall takes what it finds at every
lag, which finds trends in noise that goes together three to five times too often; it is told how often both find the same trends significant.

    make bench ARGS="maps --data FOLDER"      # the folder of `stats --data` may be used again
    make bench ARGS="maps --years 6"
"""

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import stats
import tiles

NAME = "bench-maps"
# What is asked for, a command each; the last is all that one would ask for at once.
CLIMATOLOGY, ANOMALY = ["climatology"], ["anomaly"]
TREND = ["trend", "trend-p-value"]
LEAST_SQUARES = ["least-squares-trend", "least-squares-trend-p-value"]
NORMALS = [*CLIMATOLOGY, *TREND]
ALL = [*CLIMATOLOGY, *ANOMALY, *TREND]
ASKED = [CLIMATOLOGY, ANOMALY, TREND, LEAST_SQUARES, NORMALS, ALL]
# The same with anomalies of means of months.
ASKED_BY_MONTH = [ANOMALY, ALL]
MONTHLY = "anomaly of months"
# The same on the whole grid of the product.
ON_ALL_CELLS = [ANOMALY, ALL]
# Cells that the peer tests.
TREND_CELLS = 1000
# Values that a trend needs.
LEAST_VALUES = 10
SIGNIFICANT = 0.05
# Share of cells whose p values may differ by more than a thousandth.
OTHERWISE = 0.02
# How far apart answers may be, as a share of the largest: the peer sums in 32 bits.
TOLERANCE = 2e-5
# Steps of which anomalies are compared.
STEPS = 40
YEAR_DAYS = 365.25
# Stored fluxes are kg of carbon m-2 s-1; the files hold mmol of CO2 m-2 d-1.
KG_A_SECOND = 12.011e-6 / 86_400


def main():
    options = arguments()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        folder = Path(options.data or folder)
        folder.mkdir(parents=True, exist_ok=True)
        product, _builds = stats.data(options, folder)
        peer = stats.Peer(folder, options)
        ring = stats.outline(0.007)
        with tempfile.TemporaryDirectory(dir=folder) as work:
            theirs, peer_s = xarray(folder, Path(work), peer, ring)
            own = Own(options, folder, product, ring)
            try:
                own_s = {" + ".join(asked): own.derive(asked) for asked in ASKED}
                own_s |= {by_month(asked): own.derive(asked, step="month") for asked in ASKED_BY_MONTH}
                own_s |= {on_all_cells(asked): own.derive(asked, crop=False) for asked in ON_ALL_CELLS}
                worst = compared(own.exported(Path(work)), theirs)
            finally:
                own.forget()
        print_table(options, own_s, peer_s, theirs["cells"], worst)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True, help="the fluxglobe to measure")
    parser.add_argument("--years", type=int, default=16, help="years of days")
    parser.add_argument("--folder", help="where temporary files are made")
    parser.add_argument("--data", help="folder that keeps what was made and landed, for another run")
    parser.add_argument("--json", action="store_true", help="figures as JSON")
    return parser.parse_args()


def by_month(asked):
    return " + ".join(asked).replace("anomaly", MONTHLY)


def on_all_cells(asked):
    return " + ".join(asked) + ", all cells"


class Own:
    """Products that are derived, each under a name that no run before has taken: what is there already is not derived again."""

    def __init__(self, options, folder, product, ring):
        self.program, self.folder, self.product = options.program, folder / "data", product
        self.region = "POLYGON((" + ",".join(f"{x} {y}" for x, y in [*ring, ring[0]]) + "))"
        self.name = f"{NAME}-{int(time.time())}"
        self.count = 0
        # The first product of each statistic.
        self.products = {}
        # Every file that is read was read before.
        self.derive(["mean"])

    def derive(self, statistics, step=None, crop=True):
        """Seconds of the whole command."""
        tiles.say(f"fluxglobe: {', '.join(statistics)}{f' by {step}' if step else ''}{'' if crop else ', all cells'}")
        self.count += 1
        begin = time.perf_counter()
        words = ["--region", self.region, "--statistic", ",".join(statistics), "--least-percent", 0, "--name", self.named(statistics)]
        words += ["--step", step] if step else []
        words += ["--crop"] if crop else []
        tiles.run(self.program, "--data", self.folder, "derive", "statistic", "--product", self.product, *words)
        seconds = time.perf_counter() - begin
        tiles.say(f"  {seconds:.2f} s")
        for statistic in statistics:
            key = MONTHLY if (statistic, step) == ("anomaly", "month") else statistic
            key = key if crop else on_all_cells([key])
            self.products.setdefault(key, f"{self.name}-{self.count}-{statistic}")
        return seconds

    def named(self, statistics):
        return f"{self.name}-{self.count}" if len(statistics) > 1 else f"{self.name}-{self.count}-{statistics[0]}"

    def exported(self, work):
        """What was found, by statistic, as arrays in the memory of whoever looks at them."""
        import xarray as xr

        found = {}
        for statistic, product in self.products.items():
            if statistic == "mean":
                continue
            target = work / f"{product}.zarr"
            tiles.run(self.program, "--data", self.folder, "export", product, "--to", "zarr", target)
            cube = xr.open_zarr(target)
            array = next(array for name, array in cube.data_vars.items() if array.ndim == 3)
            names = {"latitude": "lat", "longitude": "lon"}
            found[statistic] = array.rename({long: short for long, short in names.items() if long in array.dims})
        return found

    def forget(self):
        """Removes what was derived."""
        for folder in (self.folder / "objects").glob(f"*/{self.name}-*"):
            shutil.rmtree(folder)


def xarray(folder, work, peer, ring):
    """The same with the peers: what they find, and seconds of each part."""
    import flox  # noqa: F401 - xarray groups with it
    import numpy as np
    import xarray as xr

    rows, cols, weights, cells = stats.polygon_weights(peer, ring)
    inside = weights > 0
    whole = xr.open_zarr(folder / "times.zarr")["flux"][:, rows, cols]
    mask = xr.DataArray(inside, dims=("lat", "lon"), coords={"lat": whole["lat"], "lon": whole["lon"]})
    window = whole.where(mask)
    # Every file that is read was read before.
    whole.mean().compute()
    found, parts = {"cells": cells}, {}
    with xr.set_options(use_flox=True):
        tiles.say("xarray and flox: climatology")
        begin = time.perf_counter()
        found["climatology"] = window.groupby("time.month").mean().compute()
        found["climatology"].to_dataset(name="climatology").to_zarr(work / "climatology.zarr")
        parts["climatology"] = time.perf_counter() - begin

        tiles.say("xarray and flox: climatology and anomaly at once")
        months = window.groupby("time.month")
        begin = time.perf_counter()
        normals = months.mean()
        found["anomaly"] = stored(normals, months - normals, work / "anomaly.zarr")
        parts["climatology and anomaly"] = time.perf_counter() - begin

        tiles.say("xarray and flox: means of months, seasons taken off")
        begin = time.perf_counter()
        off, times = deseasonalised(window)
        parts["means of months"] = time.perf_counter() - begin
        begin = time.perf_counter()
        found[MONTHLY] = stored_months(off, times, window, work / "months.zarr")
        parts["anomalies of months stored"] = time.perf_counter() - begin
    years = middles(times)
    begin = time.perf_counter()
    found["least squares"] = least_squares(*with_their_line(off, years), years)
    parts["least squares"] = time.perf_counter() - begin
    tiles.say("pymannkendall")
    has_trend = (~np.isnan(off)).sum(axis=0) >= LEAST_VALUES
    places = np.argwhere(has_trend)
    places = places[:: max(len(places) // TREND_CELLS, 1)][:TREND_CELLS]
    found["places"] = places
    found["tests"], a_cell = tested([off[:, row, col] for row, col in places])
    found["trends"] = trends(window, places, years)
    parts["test of one cell"] = a_cell
    parts["tests"] = a_cell * int(has_trend.sum())
    found["lat"], found["lon"] = window["lat"].values, window["lon"].values
    tiles.say(f"the peer: {parts}")
    return found, parts


def deseasonalised(window):
    """Means of months at least half of which hold data, less those of their calendar month; and when they begin."""
    import dask

    months = window.resample(time="MS")
    means, counts = dask.compute(months.mean(), months.count())
    means = means.where(counts >= 0.5 * means["time"].dt.days_in_month)
    by_month = means.groupby("time.month")
    off = (by_month - by_month.mean()).transpose("time", "lat", "lon")
    return off.values.astype("float64"), means["time"].values


def with_their_line(off, years):
    """Values less their calendar months, `[time, ...]` from a January on, as they are if months' means are found together with a line: of both
    the months are taken off, and the line that one has along the other is put back. Squares of times beside the months, and how many months there are."""
    import numpy as np

    times = np.where(np.isnan(off), np.nan, years.reshape(-1, *[1] * (off.ndim - 1)))
    less = times.copy()
    with np.errstate(invalid="ignore", divide="ignore"):
        for month in range(12):
            one = less[month::12]
            count = (~np.isnan(one)).sum(axis=0)
            less[month::12] -= np.nansum(one, axis=0) / count
        slope = np.nansum(less * off, axis=0) / np.nansum(less * less, axis=0)
        count = sum((~np.isnan(off[month::12])).any(axis=0) for month in range(12))
        return off + slope * (times - less), np.nansum(less * less, axis=0), count


def stored(climatology, anomaly, place):
    """Both, each part of the cube read once; anomalies in the layout that they are read in: chunks of all of time."""
    import xarray as xr

    anomaly = anomaly.drop_vars("month", errors="ignore").astype("float32").transpose("time", "lat", "lon")
    both = {"climatology": climatology.chunk({"lat": 41, "lon": 45}), "anomaly": anomaly.chunk({"time": -1, "lat": 41, "lon": 45})}
    for array in both.values():
        array.encoding = {}
    xr.Dataset(both).to_zarr(place)
    return xr.open_zarr(place)["anomaly"]


def stored_months(anomalies, months, window, place):
    """Anomalies of months, in chunks of all of time."""
    import xarray as xr

    axes = {"time": months, "lat": window["lat"].values, "lon": window["lon"].values}
    array = xr.DataArray(anomalies.astype("float32"), dims=tuple(axes), coords=axes)
    array.chunk({"time": -1, "lat": 41, "lon": 45}).to_dataset(name="anomaly").to_zarr(place)
    return xr.open_zarr(place)["anomaly"]


def middles(months):
    """Middles of months, years after the first one's."""
    import numpy as np

    last = months[-1].astype("datetime64[M]") + np.timedelta64(1, "M")
    edges = np.append(months.astype("datetime64[M]"), last).astype("datetime64[ms]")
    middle = edges[:-1] + (edges[1:] - edges[:-1]) / 2
    return (middle - middle[0]).astype("float64") / 86_400_000 / YEAR_DAYS


def least_squares(values, squared_years, month_count, years):
    """Slope a year and its p value of each cell, of values in `[time, lat, lon]`, NaN no data."""
    import numpy as np
    from scipy.stats import t

    here, x, steps = ~np.isnan(values), years[:, None, None], len(years)
    n = here.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.nansum(values, axis=0) / n
        from_mean = np.where(here, x - (here * x).sum(axis=0) / n, 0)
        squares_x = (from_mean**2).sum(axis=0)
        slope = (from_mean * np.where(here, values - mean, 0)).sum(axis=0) / squares_x
        left = np.where(here, values - mean - slope * from_mean, 0)
        squares = (left**2).sum(axis=0)
        pairs = (here[:-1] & here[1:]).sum(axis=0)
        r = np.clip((left[:-1] * left[1:]).sum(axis=0) / pairs * (steps - 1) / steps / (squares / n), 0, 1)
        effective = n * (1 - r) / (1 + r)
        freedom = effective - 2 - (month_count - 1) * effective / n
        error = np.sqrt(squares / freedom / squared_years)
        p = 2 * t.sf(np.abs(slope / error), freedom)
    is_told = n >= LEAST_VALUES
    return {"least-squares-trend": np.where(is_told, slope, np.nan), "least-squares-trend-p-value": np.where(is_told, p, np.nan)}


def tested(series):
    """P values of pymannkendall, and seconds that the test of one series takes all processors."""
    workers = os.cpu_count()
    with ProcessPoolExecutor(workers) as pool:
        # Whoever is started imports first; that is not timed.
        list(pool.map(test_of, [series[0]] * workers * 2))
        begin = time.perf_counter()
        tests = list(pool.map(test_of, series, chunksize=25))
        return tests, (time.perf_counter() - begin) / len(series)


def test_of(values):
    import pymannkendall

    return pymannkendall.hamed_rao_modification_test(values).p


def trends(window, places, years):
    """What trends of some cells are to be: slope a year and p value, from means in 64 bits. Not timed."""
    import numpy as np
    import xarray as xr

    rows, cols = (xr.DataArray(side, dims="cell") for side in places.T)
    values = window.isel(lat=rows, lon=cols).transpose("time", "cell")
    month = values["time"].values.astype("datetime64[M]").astype(int)
    month -= month[0]
    values = values.values.astype("float64")
    here = ~np.isnan(values)
    sums, counts = np.zeros((2, len(years), len(places)))
    np.add.at(sums, month, np.where(here, values, 0))
    np.add.at(counts, month, here)
    days = np.bincount(month)[:, None]
    with np.errstate(invalid="ignore"):
        means = np.where(counts >= 0.5 * days, sums / counts, np.nan)
    # The first one is a January.
    for calendar in range(12):
        means[calendar::12] -= np.nanmean(means[calendar::12], axis=0)
    lined, _squares, _months = with_their_line(means, years)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(in_time_of, [(one, line, years) for one, line in zip(means.T, lined.T)], chunksize=25))


def in_time_of(asked):
    """Slope a year through the middles of months, and Mann and Kendall's p value with months in their places."""
    import numpy as np
    from scipy.stats import norm, rankdata, theilslopes

    values, lined, years = asked
    here = ~np.isnan(values)
    score = np.sign(values[here][None, :] - values[here][:, None])[np.triu_indices(here.sum(), 1)].sum()
    slope = theilslopes(lined[here], years[here])[0]
    steps, n = len(values), here.sum()
    ranks = np.zeros(steps)
    ranks[here] = rankdata((lined - slope * years)[here]) - (n + 1) / 2
    pairs = (here[1:] & here[:-1]).sum()
    r = (ranks[1:] * ranks[:-1]).sum() / pairs * (steps - 1) / steps / ((ranks**2).sum() / n) if pairs else 0.0
    lags = np.arange(1, n)
    weights = (n - lags) * (n - lags - 1) * (n - lags - 2)
    is_chance = abs(r) <= norm.ppf(0.975) / np.sqrt(n)
    all_of_them = 0.0 if is_chance else (weights * np.clip(r, -1, 1) ** lags).sum()
    # Autocorrelation is never a reason to be surer.
    correction = max(1 + 2 / (n * (n - 1) * (n - 2)) * all_of_them, 1)
    z = (score - np.sign(score)) / np.sqrt(n * (n - 1) * (2 * n + 5) / 18 * correction)
    return slope, 2 * norm.sf(abs(z))


def compared(ours, theirs):
    """How far answers are apart; the program ends where that is much."""
    import numpy as np

    worst = {}

    def check(name, own, other, most=TOLERANCE, scale=None):
        own, other = np.asarray(own, "float64"), np.asarray(other, "float64")
        if own.shape != other.shape or (np.isnan(own) != np.isnan(other)).any():
            gaps = (np.isnan(own) != np.isnan(other)).sum() if own.shape == other.shape else "all"
            sys.exit(f"{name}: shapes {own.shape}, {other.shape}, or gaps at {gaps} other places")
        worst[name] = float(np.nanmax(np.abs(own - other)) / (scale or np.nanmax(np.abs(other))))
        if worst[name] > most:
            sys.exit(f"{name}: answers differ by {worst[name]:.2e}, where {most:.0e} is allowed")

    lat, lon = theirs["lat"], theirs["lon"]

    def cells(statistic):
        return ours[statistic].sel(lat=lat, lon=lon, method="nearest")

    other = theirs["climatology"].transpose("month", "lat", "lon").values
    check("climatology", cells("climatology").values, other * KG_A_SECOND)
    steps = np.unique(np.linspace(0, theirs["anomaly"].sizes["time"] - 1, STEPS).round().astype(int))
    own, other = cells("anomaly").isel(time=steps), theirs["anomaly"].isel(time=steps)
    if (own["time"].values.astype("datetime64[D]") != other["time"].values.astype("datetime64[D]")).any():
        sys.exit("anomaly: steps of other days")
    check("anomaly", own.values, other.values * stats.GRAMS_A_YEAR)
    own = cells(on_all_cells(ANOMALY)).isel(time=steps)
    check(on_all_cells(ANOMALY), own.values, other.values * stats.GRAMS_A_YEAR)
    own, other = cells(MONTHLY), theirs[MONTHLY]
    # A month is told by its middle here, by its first instant there.
    if (own["time"].values.astype("datetime64[M]") != other["time"].values.astype("datetime64[M]")).any():
        sys.exit("anomaly of months: other months")
    check(MONTHLY, own.values, other.values * stats.GRAMS_A_YEAR)
    slope = cells("least-squares-trend").isel(time=0).values
    check("least-squares-trend", slope, theirs["least squares"]["least-squares-trend"] * stats.GRAMS_A_YEAR)
    p_value = cells("least-squares-trend-p-value").isel(time=0).values
    check("least-squares-trend-p-value", p_value, theirs["least squares"]["least-squares-trend-p-value"], most=1e-4, scale=1.0)
    compare_tests(check, worst, cells, theirs)
    return worst


def compare_tests(check, worst, cells, theirs):
    import numpy as np

    rows, cols = theirs["places"].T
    slope, p = np.array(theirs["trends"]).T
    check("trend", cells("trend").isel(time=0).values[rows, cols], slope * stats.GRAMS_A_YEAR)
    own = cells("trend-p-value").isel(time=0).values[rows, cols]
    apart = np.abs(own - p)
    # The two values whose slope is the median tie by construction once it is taken off: rounding decides which ranks first, and where
    # a lag is just significant or just not, that decides it. So does another unit in one and the same program.
    beyond = {limit: int((apart > limit).sum()) for limit in (1e-5, 1e-3)}
    worst["trend-p-value"] = f"of {len(p)} cells {beyond[1e-5]} beyond 1e-5, {beyond[1e-3]} beyond 1e-3, {apart.max():.1e} at most"
    if beyond[1e-3] > len(p) * OTHERWISE or np.isnan(apart).any():
        sys.exit(f"trend-p-value: {worst['trend-p-value']}")
    same = ((own < SIGNIFICANT) == (np.array(theirs["tests"]) < SIGNIFICANT)).sum()
    worst["cells that pymannkendall finds significant where we do, and only there"] = f"{same} of {len(p)}"


def print_table(options, own_s, peer_s, cells, worst):
    means, climatology = peer_s["means of months"], peer_s["climatology"]
    both = peer_s["climatology and anomaly"]
    theirs = {
        "climatology": climatology,
        "anomaly": both,
        " + ".join(TREND): means + peer_s["tests"],
        " + ".join(LEAST_SQUARES): means + peer_s["least squares"],
        " + ".join(NORMALS): climatology + means + peer_s["tests"],
        " + ".join(ALL): both + means + peer_s["tests"],
        MONTHLY: means + peer_s["anomalies of months stored"],
        by_month(ALL): climatology + means + peer_s["anomalies of months stored"] + peer_s["tests"],
    }
    theirs |= {on_all_cells(asked): theirs[" + ".join(asked)] for asked in ON_ALL_CELLS}
    if options.json:
        print(json.dumps({"ours_s": own_s, "peer_s": theirs, "peer_parts_s": peer_s, "cells": cells, "differ": worst}, indent=1))
        return
    print(f"{os.cpu_count()} processors, {options.years} years of days, {cells} cells of a polygon, files in the page cache, what is found is stored")
    print(f"{'statistic':60}{'fluxglobe':>12}{'the peer':>12}{'times':>9}")
    for name, seconds in own_s.items():
        print(f"{name:60}{seconds:10.2f} s{theirs[name]:10.2f} s{theirs[name] / seconds:8.1f}x")
    one = peer_s["test of one cell"] * 1e3
    print(f"of the peer's trends {peer_s['tests']:.1f} s are reckoned: {TREND_CELLS} cells were tested, one takes all processors {one:.2f} ms")
    rest = peer_s["least squares"] + peer_s["means of months"]
    print(f"the peer, all with least squares in place of its test: {both + rest:.1f} s")
    for name, value in worst.items():
        print(f"  {name}: {value:.1e}" if isinstance(value, float) else f"  {name}: {value}")


if __name__ == "__main__":
    main()
