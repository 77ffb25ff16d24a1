"""Statistics over many years: `fluxglobe serve` beside xarray and dask, on the same values, one machine, in one run.

The made-up China Sea (`fluxglobe generate china-sea --years N`, 450 x 615 cells a day) is landed here, and written as Zarr there
in two layouts: whole maps by 32 steps, and tiles of 41 x 45 cells over all of time. For each question the peer's better layout
counts, its weights made before it is timed; ours are made within the time. Both sides' files are in the page cache, but for
`cold`: ours by a server that was just started, theirs in the same layout, each with its files out of the page cache (what the
disk itself keeps is not in our hands). Answers of both are compared before any figure is printed.

Every question of ours is a new one, over a place that was not asked for before; `again` asks the same a second time. Ours come as
Arrow and are timed until they are arrays, as the peer's are; the lines `as JSON` are those of the text with a name for each number of each
row, asked for over other places. Both are asked through one connection that stays open. A hundred
polygons at once are compared with exactextract, which is run once a step; a part of the steps is timed, and the rest reckoned.
No vertex of these lies on a line between cells: exactextract 0.3.0 may lose a whole cell there, as shapely shows.

    make bench ARGS="stats"            # 16 years need 25 GB of disk and 12 GB of memory
    make bench ARGS="stats --years 2"
"""

import argparse
import http.client
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import urllib.parse
from pathlib import Path

import tiles

SCALE = 0.25
SEED = 1
# What the files hold is mmol CO2 m-2 d-1, what our answers hold g C m-2 a-1.
GRAMS_A_YEAR = tiles.GRAMS_A_YEAR
REPEATS = 5
# The longest query that the server takes has room for so many places of four decimals.
VERTICES = 500
# Polygons that are asked for together, and steps in which exactextract is timed.
POLYGONS = 100
EXTRACTED = 40
# Ours and theirs may differ by rounding to six digits, and by how a cell is cut along a slanted edge.
TOLERANCE = 2e-4


def main():
    options = arguments()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        folder = Path(options.data or folder)
        folder.mkdir(parents=True, exist_ok=True)
        product, builds = data(options, folder)
        peer = Peer(folder, options)
        ours = Ours(options, folder, product)
        try:
            rows = [question(ours, peer) for question in (point, line, polygon, polygon_year, hundred_polygons)]
        finally:
            ours.stop()
        print_table(rows, builds, peer, options)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True, help="the fluxglobe to measure")
    parser.add_argument("--years", type=int, default=16, help="years of days")
    parser.add_argument("--folder", help="where temporary files are made")
    parser.add_argument("--data", help="folder that keeps what was made and landed, for another run")
    parser.add_argument("--json", action="store_true", help="figures as JSON")
    return parser.parse_args()


def made(program, years, folder):
    """Files of the made-up China Sea, one a year."""
    # Of a run that was ended before it had landed them: nothing is written over.
    for left in folder.glob("sea-[0-9][0-9][0-9][0-9].h5"):
        left.unlink()
    return tiles.run(program, "generate", "china-sea", "--scale", SCALE, "--seed", SEED, "--years", years, "--output", folder / "sea.h5").split()


def data(options, folder):
    """Lands the files here and writes them as Zarr there; how long each took, and what it holds on disk."""
    builds = folder / "builds.json"
    if builds.exists():
        told = json.loads(builds.read_text())
        return told["product"], told["builds"]
    program = options.program
    tiles.say(f"making {options.years} years of the China Sea")
    files = made(program, options.years, folder)
    tiles.say("landing them")
    begin = time.time()
    tiles.run(program, "--data", folder / "data", "ingest", *files)
    landed = time.time() - begin
    listed = json.loads(tiles.run(program, "--data", folder / "data", "products", "--json"))
    product = next(row["product"] for row in listed if not row["product"].endswith("-accumulated"))
    tiles.say("writing Zarr")
    begin = time.time()
    write_zarr(files, folder)
    written = time.time() - begin
    told = [
        {"who": "fluxglobe: both layouts", "seconds": landed, "bytes": size(folder / "data")},
        {"who": "xarray: both layouts", "seconds": written, "bytes": size(folder / "maps.zarr") + size(folder / "times.zarr")},
    ]
    builds.write_text(json.dumps({"product": product, "builds": told}))
    return product, told


def evict(folder):
    """Takes the files of a folder out of the page cache."""
    for path in folder.rglob("*"):
        if path.is_file():
            with path.open("rb") as file:
                os.fsync(file.fileno())
                os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def size(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def write_zarr(files, folder):
    import numpy as np
    import xarray as xr

    opened = [xr.open_dataset(file, engine="h5netcdf", phony_dims="sort") for file in files]
    name = next(name for name, array in opened[0].data_vars.items() if array.ndim == 3)
    lat, lon = opened[0]["lat"].values, opened[0]["lon"].values
    times = np.concatenate([one["time"].values for one in opened])
    # All of it once, and no more.
    values = np.empty((len(times), len(lat), len(lon)), "float32")
    at = 0
    for one in opened:
        with one:
            count = one.sizes[one[name].dims[0]]
            values[at : at + count] = one[name].values
            at += count
    cube = xr.Dataset({"flux": (("time", "lat", "lon"), values)}, coords={"time": times, "lat": lat, "lon": lon})
    rows, cols = len(lat), len(lon)
    cube.to_zarr(folder / "maps.zarr", encoding={"flux": {"chunks": (32, rows, cols)}})
    cube.to_zarr(folder / "times.zarr", encoding={"flux": {"chunks": (len(cube["time"]), 41, 45)}})


class Peer:
    """xarray with dask, its two layouts opened."""

    def __init__(self, folder, options):
        import dask
        import xarray as xr

        dask.config.set(scheduler="threads", num_workers=os.cpu_count())
        self.folder = folder
        self.cubes = {name: xr.open_zarr(folder / f"{name}.zarr")["flux"] for name in ("maps", "times")}
        any_cube = self.cubes["times"]
        self.lat, self.lon = any_cube["lat"].values, any_cube["lon"].values
        self.steps = any_cube.sizes["time"]

    def best(self, ask):
        """The quickest answer of the better layout: name, seconds, answer."""
        tried = []
        for name, cube in self.cubes.items():
            ask(cube)
            times = []
            for _ in range(3):
                begin = time.perf_counter()
                answer = ask(cube)
                times.append(time.perf_counter() - begin)
            tried.append((min(times), name, answer))
        best = min(tried, key=lambda it: it[0])
        evict(self.folder / f"{best[1]}.zarr")
        begin = time.perf_counter()
        ask(self.cubes[best[1]])
        return (*best, time.perf_counter() - begin)

    def weighted_mean(self, rows, cols, weights):
        """Asks for the mean over cells that weigh `weights`, step by step."""
        import xarray as xr

        own = xr.DataArray(weights, dims=("lat", "lon"))

        def ask(cube):
            window = cube[:, rows, cols].drop_vars(["lat", "lon"])
            return window.weighted(own).mean(("lat", "lon")).values

        return ask

    def areas(self):
        """Areas of cells on WGS84 by row, m2."""
        from pyproj import Geod

        geod = Geod(ellps="WGS84")
        half = abs(self.lat[1] - self.lat[0]) / 2
        wide = abs(self.lon[1] - self.lon[0])
        found = []
        for lat in self.lat:
            # Parallels are no geodesics: many short ones are.
            along = [wide * part / 64 for part in range(65)]
            lons = along + along[::-1]
            lats = [lat - half] * 65 + [lat + half] * 65
            found.append(abs(geod.polygon_area_perimeter(lons, lats)[0]))
        return found


class Ours:
    """A running server, asked over HTTP."""

    def __init__(self, options, folder, product):
        self.program = options.program
        self.folder = folder / "data"
        self.product = product
        self.start()

    def start(self):
        self.port = tiles.free_port()
        self.process = subprocess.Popen(
            # Nothing is drawn, and a machine without a Vulkan device can measure too.
            [self.program, "--data", self.folder, "serve", "--cpu", "--listen", f"127.0.0.1:{self.port}"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        tiles.wait_for(self.port, "/readyz")
        self.connection = http.client.HTTPConnection("127.0.0.1", self.port)

    def stop(self):
        self.connection.close()
        self.process.terminate()
        self.process.wait(timeout=60)

    def ask(self, what, form, **parameters):
        """Seconds until the answer is here, as arrays if it is Arrow, and it."""
        query = urllib.parse.urlencode({**parameters, "format": form})
        begin = time.perf_counter()
        self.connection.request("GET", f"/api/products/{self.product}/{what}?{query}")
        response = self.connection.getresponse()
        content = response.read()
        if response.status != 200:
            sys.exit(f"{what}: {response.status}: {content[:300]}")
        answer = arrays(content) if form == "arrow" else content
        return time.perf_counter() - begin, answer

    def warm(self, what, variants):
        """Brings what questions read into the page cache, where the peer's files are too, and begins again without an answer."""
        # The peer may have taken longer than a server waits for another request.
        self.connection.close()
        for parameters in variants:
            self.ask(what, "arrow", **parameters)
        self.stop()
        self.start()
        # A corner that no question asks for: the product's newest version is opened.
        self.ask("point", "arrow", lon=129.9, lat=29.9)

    def new(self, what, variants):
        """Questions that are new, the one half as Arrow, the other as JSON: of each the median, and the last one asked again; the first
        one asked cold, and its answer."""
        self.warm(what, variants)
        half = len(variants) // 2
        found, first = {}, None
        for form, own in (("arrow", variants[:half]), ("json", variants[half:])):
            times = []
            for parameters in own:
                seconds, answer = self.ask(what, form, **parameters)
                times.append(seconds)
                first = first or answer
            again = min(self.ask(what, form, **own[-1])[0] for _ in range(3))
            found[form] = [sorted(times)[len(times) // 2], again]
        self.stop()
        evict(self.folder)
        self.start()
        cold = self.ask(what, "arrow", **variants[0])[0]
        return {"answer": first, "arrow": found["arrow"], "cold": cold, "json": found["json"]}


def arrays(content):
    """Columns of an answer by their names."""
    import pyarrow as pa

    table = pa.ipc.open_file(pa.BufferReader(content)).read_all()
    return {name: table[name].to_numpy() for name in table.column_names}


def values_of(answer):
    values = answer["value" if "value" in answer else "mean"]
    return [None if math.isnan(value) else value for value in values]


def compared(name, ours, theirs):
    if len(ours) != len(theirs):
        sys.exit(f"{name}: {len(ours)} steps beside {len(theirs)}")
    scale = max(abs(float(value)) for value in theirs if not math.isnan(value)) * GRAMS_A_YEAR
    worst = 0.0
    for step, (own, other) in enumerate(zip(ours, theirs)):
        if own is None or math.isnan(other):
            if (own is None) != math.isnan(other):
                sys.exit(f"{name}, step {step}: {own} beside {other}")
            continue
        worst = max(worst, abs(own - other * GRAMS_A_YEAR) / scale)
    if worst > TOLERANCE:
        sys.exit(f"{name}: answers differ by {worst:.2e} of the largest")
    return worst


def row(name, ours, peer, differ):
    seconds, layout, _answer, cold = peer
    own = {"ours_s": ours["arrow"][0], "again_s": ours["arrow"][1], "cold_s": ours["cold"]}
    own["json_s"], own["json_again_s"] = ours["json"]
    return {"question": name, **own, "peer_s": seconds, "peer_cold_s": cold, "layout": layout, "differ": differ}


def point(ours, peer):
    tiles.say("a point")
    places = [(114.0333 + 0.1 * at, 14.0333 + 0.1 * at) for at in range(2 * REPEATS)]
    own = ours.new("point", [{"lon": lon, "lat": lat} for lon, lat in places])
    lon, lat = places[0]
    other = peer.best(lambda cube: cube.sel(lon=lon, lat=lat, method="nearest").values)
    return row("point, all steps", own, other, compared("point", values_of(own["answer"]), other[2]))


def line(ours, peer):
    """500 vertices from the Gulf of Tonkin to Palawan and back, wound: the cells nearest to each vertex at the peer's."""
    tiles.say("a line of 500 vertices")
    import numpy as np
    import xarray as xr

    def vertices(shift):
        at = np.linspace(0, 1, VERTICES)
        return np.round(108 + shift + 10 * at, 4), np.round(18.5 + shift - 8 * at + 0.8 * np.sin(25 * at), 4)

    texts = []
    for number in range(2 * REPEATS):
        lon, lat = vertices(0.05 * number)
        texts.append(";".join(f"{x:.4f},{y:.4f}" for x, y in zip(lon, lat)))
    own = ours.new("line", [{"line": text, "step": "native", "statistic": "mean"} for text in texts])
    # The peer's way: points close together along the line, each the value of its cell, by the length it stands for.
    weights = line_weights(peer, *vertices(0.0))
    rows, cols, shares = weights
    places = {"lat": xr.DataArray(rows, dims="cell"), "lon": xr.DataArray(cols, dims="cell")}
    share = xr.DataArray(shares, dims="cell")
    other = peer.best(lambda cube: cube.isel(**places).drop_vars(["lat", "lon"]).weighted(share).mean("cell").values)
    return row("line of 500 vertices, all steps", own, other, compared("line", values_of(own["answer"]), other[2]))


def line_weights(peer, lon, lat):
    """Length of a line in each cell: rows, columns, metres."""
    import numpy as np
    from pyproj import Geod

    geod = Geod(ellps="WGS84")
    parts = {}
    for at in range(len(lon) - 1):
        *_, length = geod.inv(lon[at], lat[at], lon[at + 1], lat[at + 1])
        pieces = 400
        inner = (np.arange(pieces) + 0.5) / pieces
        xs = lon[at] + inner * (lon[at + 1] - lon[at])
        ys = lat[at] + inner * (lat[at + 1] - lat[at])
        col = np.floor((xs - peer.lon[0]) / (peer.lon[1] - peer.lon[0]) + 0.5).astype(int)
        row_ = np.floor((ys - peer.lat[0]) / (peer.lat[1] - peer.lat[0]) + 0.5).astype(int)
        for key in zip(row_, col):
            parts[key] = parts.get(key, 0.0) + length / pieces
    keys = sorted(parts)
    return [key[0] for key in keys], [key[1] for key in keys], np.array([parts[key] for key in keys])


def outline(shift):
    """Some 46,000 cells of the South China Sea, with a coast of bays."""
    around = [2 * math.pi * at / 48 for at in range(48)]
    radius = [8.05 + 0.9 * math.sin(5 * angle) + 0.5 * math.cos(9 * angle) for angle in around]
    ring = [(115 + shift + r * math.cos(a), 15 + shift + r * math.sin(a)) for r, a in zip(radius, around)]
    return [(round(x, 5), round(y, 5)) for x, y in ring]


def polygon_weights(peer, ring):
    """Areas of cells inside: rows and columns as slices, weights, cells that have any."""
    import numpy as np
    import shapely

    area = np.array(peer.areas())
    shape = shapely.Polygon(ring)
    west, south, east, north = shape.bounds
    dlat, dlon = peer.lat[1] - peer.lat[0], peer.lon[1] - peer.lon[0]
    rows = np.flatnonzero((peer.lat + abs(dlat) / 2 > south) & (peer.lat - abs(dlat) / 2 < north))
    cols = np.flatnonzero((peer.lon + dlon / 2 > west) & (peer.lon - dlon / 2 < east))
    rows, cols = slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)
    x, y = np.meshgrid(peer.lon[cols], peer.lat[rows])
    boxes = shapely.box(x - dlon / 2, y - abs(dlat) / 2, x + dlon / 2, y + abs(dlat) / 2)
    share = shapely.area(shapely.intersection(boxes, shape)) / (abs(dlat) * dlon)
    weights = share * area[rows][:, None]
    return rows, cols, weights, int((share > 0).sum())


def polygon(ours, peer):
    tiles.say("a polygon")
    rings = [outline(0.021 * at) for at in range(2 * REPEATS)]
    texts = ["POLYGON((" + ",".join(f"{x} {y}" for x, y in [*ring, ring[0]]) + "))" for ring in rings]
    own = ours.new("area", [{"region": text, "statistic": "mean", "step": "native"} for text in texts])
    rows, cols, weights, cells = polygon_weights(peer, rings[0])
    other = peer.best(peer.weighted_mean(rows, cols, weights))
    return row(f"polygon of {cells} cells, all steps", own, other, compared("polygon", values_of(own["answer"]), other[2]))


def polygon_year(ours, peer):
    """The last year of it alone."""
    tiles.say("a polygon, one year")
    rings = [outline(0.013 + 0.023 * at) for at in range(2 * REPEATS)]
    texts = ["POLYGON((" + ",".join(f"{x} {y}" for x, y in [*ring, ring[0]]) + "))" for ring in rings]
    period = {"from": "2010", "to": "2011"} if peer.steps > 365 else {}
    own = ours.new("area", [{"region": text, "statistic": "mean", "step": "native", **period} for text in texts])
    rows, cols, weights, cells = polygon_weights(peer, rings[0])
    mean = peer.weighted_mean(rows, cols, weights)
    year = slice(365, 730) if peer.steps > 365 else slice(None)
    other = peer.best(lambda cube: mean(cube[year]))
    return row(f"polygon of {cells} cells, 365 steps", own, other, compared("polygon, a year", values_of(own["answer"]), other[2]))


def hundred_polygons(ours, peer):
    """A hundred polygons of some hundred to a few thousand cells, all steps of each, beside exactextract once a step."""
    tiles.say("a hundred polygons")
    import numpy as np
    from exactextract import exact_extract
    from exactextract.raster import NumPyRasterSource

    rings = []
    for number in range(POLYGONS):
        x, y = 110.5137 + 0.9 * (number % 10), 8.5191 + 0.9 * (number // 10)
        around = [2 * math.pi * at / 24 for at in range(24)]
        radius = [0.7 + 0.9 * (number % 7) / 7 + 0.2 * math.sin(3 * angle) for angle in around]
        rings.append([(round(x + r * math.cos(a), 5), round(y + r * math.sin(a), 5)) for r, a in zip(radius, around)])
    texts = ["POLYGON((" + ",".join(f"{x} {y}" for x, y in [*ring, ring[0]]) + "))" for ring in rings]
    asked = [{"region": text, "statistic": "mean", "step": "native"} for text in texts]

    def all_of_them(form):
        begin = time.perf_counter()
        answers = [ours.ask("area", form, **one)[1] for one in asked]
        return time.perf_counter() - begin, answers

    ours.warm("area", asked)
    first, answers = all_of_them("arrow")
    again, _answers = all_of_them("arrow")
    json_known, _texts = all_of_them("json")
    json_again, _texts = all_of_them("json")
    own = [values_of(answer) for answer in answers]

    dlat, dlon = abs(peer.lat[1] - peer.lat[0]), peer.lon[1] - peer.lon[0]
    bounds = {
        "xmin": float(peer.lon.min() - dlon / 2),
        "ymin": float(peer.lat.min() - dlat / 2),
        "xmax": float(peer.lon.max() + dlon / 2),
        "ymax": float(peer.lat.max() + dlat / 2),
    }
    is_from_south = peer.lat[1] > peer.lat[0]
    north_up = (lambda grid: grid[::-1]) if is_from_south else (lambda grid: grid)
    area = np.repeat(np.array(peer.areas())[:, None], len(peer.lon), axis=1)
    weights = NumPyRasterSource(np.ascontiguousarray(north_up(area)), **bounds)
    features = [
        {"type": "Feature", "properties": {"id": at}, "geometry": {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}}
        for at, ring in enumerate(rings)
    ]
    # Steps spread over all of time, in memory before they are timed.
    timed = sorted({round(at * (peer.steps - 1) / (EXTRACTED - 1)) for at in range(EXTRACTED)})
    maps = [np.ascontiguousarray(north_up(peer.cubes["maps"][step].values)) for step in timed]
    begin = time.perf_counter()
    theirs = [
        exact_extract(NumPyRasterSource(values, nodata=float("nan"), **bounds), features, "weighted_mean", weights=weights)
        for values in maps
    ]
    seconds = (time.perf_counter() - begin) / len(timed) * peer.steps
    worst = 0.0
    for at in range(POLYGONS):
        means = [float(found[at]["properties"]["weighted_mean"]) for found in theirs]
        worst = max(worst, compared(f"polygon {at}", [own[at][step] for step in timed], means))
    measured = {"arrow": [first, again], "cold": None, "json": [json_known, json_again]}
    return row(f"{POLYGONS} polygons, all steps", measured, (seconds, "exactextract", None, None), worst)


def print_table(rows, builds, peer, options):
    if options.json:
        print(json.dumps({"steps": peer.steps, "builds": builds, "questions": rows}))
        return
    print(f"{peer.steps} steps of {len(peer.lat)} x {len(peer.lon)} cells, {os.cpu_count()} cores, files in the page cache, equal answers")
    for build in builds:
        print(f"  {build['who']:28} {build['seconds']:8.1f} s {build['bytes'] / 1e9:8.2f} GB")
    heads = f"{'question':40} {'fluxglobe':>12} {'again':>10} {'cold':>10} {'the peer':>14} {'cold':>12} {'layout':>12}"
    print(f"{heads} {'times':>7} {'again':>7} {'cold':>7} {'differ':>9}")
    for row_ in rows:
        times, again = (row_["peer_s"] / row_[key] for key in ("ours_s", "again_s"))
        cold, peer_cold = row_["cold_s"], row_["peer_cold_s"]
        ratio = f"{peer_cold / cold:6.1f}x" if cold else f"{'':7}"
        cells = [
            f"{row_['question']:40}",
            f"{row_['ours_s'] * 1e3:9.1f} ms",
            f"{row_['again_s'] * 1e3:7.1f} ms",
            f"{cold * 1e3:7.1f} ms" if cold else f"{'':10}",
            f"{row_['peer_s'] * 1e3:11.1f} ms",
            f"{peer_cold * 1e3:9.1f} ms" if peer_cold else f"{'':12}",
            f"{row_['layout']:>12}",
            f"{times:6.1f}x {again:6.0f}x {ratio} {row_['differ']:9.1e}",
        ]
        print(" ".join(cells))
        as_json = [row_[key] * 1e3 for key in ("json_s", "json_again_s")]
        times, again = (row_["peer_s"] / row_[key] for key in ("json_s", "json_again_s"))
        # Sums of a hundred regions are known by then: it is the text that is written.
        what = "  its sums known, as JSON" if cold is None else "  as JSON"
        print(f"{what:40} {as_json[0]:9.1f} ms {as_json[1]:7.1f} ms {'':67} {times:6.1f}x {again:6.0f}x")


if __name__ == "__main__":
    main()
