"""Thematic tiles of new instants: `fluxglobe serve` beside titiler-xarray, on one grid, one machine, in one run.

Both draw tiles of 256 x 256 pixels of the same values: the made-up China Sea (`fluxglobe generate china-sea`). Titiler reads
them from Zarr, one chunk a step, which is its best case; with two workers. `wrk` asks both for the same places at instants that
were not asked for before. First, values of both at the same places and times are compared, and the shares of sea in a tile:
figures of servers that answer different things say nothing.

    make bench ARGS="tiles"            # or: python tests/bench/tiles.py --program target/debug/fluxglobe
"""

import argparse
import json
import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.parse
import urllib.request
from pathlib import Path

# Tiles that lie within what the file covers, 0 to 41 N, 100 to 130 E.
ZOOM, COLS, ROWS = 6, range(50, 53), range(25, 31)
# What the file holds is mmol CO2 m-2 d-1, what our answers hold g C m-2 a-1.
GRAMS_A_YEAR = 12.011e-3 * 365.25
# 450 x 615 cells.
SCALE = 0.25
DAYS = 120
SEED = 1


def main():
    options = arguments()
    if shutil.which("wrk") is None:
        sys.exit("`wrk` asks the servers and is not here: apt-get install wrk")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        source, cube = data(options.program, folder)
        answers = []
        for start in (fluxglobe, titiler):
            server = start(options, folder, cube)
            try:
                answers.append(measured(server, cube, options))
            finally:
                server["process"].terminate()
                server["process"].wait(timeout=60)
        compare(answers, cube)
        print_table(answers, options, source)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True, help="the fluxglobe to measure")
    parser.add_argument("--clients", type=int, default=16, help="connections of wrk")
    parser.add_argument("--seconds", type=int, default=20, help="how long each server is asked")
    parser.add_argument("--workers", type=int, default=2, help="processes of titiler")
    parser.add_argument("--json", action="store_true", help="figures as JSON")
    return parser.parse_args()


def say(text):
    print(text, file=sys.stderr, flush=True)


def data(program, folder):
    """The same values twice: landed in a store of ours, and as Zarr."""
    import h5netcdf  # noqa: F401 - xarray reads the file with it
    import xarray as xr

    source = folder / "china-sea.h5"
    say(f"making {DAYS} days of the China Sea")
    run(program, "generate", "china-sea", "--scale", SCALE, "--seed", SEED, "--days", DAYS, "--output", source)
    run(program, "--data", folder / "data", "ingest", source)
    listed = json.loads(run(program, "--data", folder / "data", "products", "--json"))
    product = next(row["product"] for row in listed if not row["product"].endswith("-accumulated"))
    with xr.open_dataset(source, engine="h5netcdf", phony_dims="sort") as file:
        variable = next(name for name, array in file.data_vars.items() if array.ndim == 3)
        cube = file[variable].load().to_dataset(name="flux")
    time_name, lat_name, lon_name = cube["flux"].dims
    cube = cube.rename({time_name: "time", lat_name: "lat", lon_name: "lon"})
    path = folder / "cube.zarr"
    cube.to_zarr(path, encoding={"flux": {"chunks": (1, *cube["flux"].shape[1:])}})
    return source, {"data": cube, "path": path, "product": product}


def run(program, *arguments_):
    done = subprocess.run([str(program), *map(str, arguments_)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{program} {arguments_}: {done.stderr}")
    return done.stdout


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def fluxglobe(options, folder, cube):
    port = free_port()
    process = subprocess.Popen(
        [options.program, "--data", folder / "data", "serve", "--listen", f"127.0.0.1:{port}"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    product = cube["product"]

    def path(z, x, y, instant, step):
        del step
        # Between steps values are interpolated: more work than the nearest one is.
        return f"/tiles/{product}/map/{z}/{x}/{y}.png?time={instant}"

    def value(lon, lat, step):
        answer = json.loads(get(port, f"/api/products/{product}/point?lon={lon}&lat={lat}"))
        return answer["series"][step]["value"] / GRAMS_A_YEAR

    wait_for(port, "/readyz")
    return {"name": "fluxglobe serve", "port": port, "process": process, "path": path, "value": value}


def titiler(options, folder, cube):
    port = free_port()
    environment = {
        **os.environ,
        "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
        "GDAL_CACHEMAX": "200",
    }
    process = subprocess.Popen(
        [sys.executable, "-m", "uvicorn", "titiler.xarray.main:app", "--port", str(port), "--workers", str(options.workers), "--log-level", "error"],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    url = urllib.parse.quote(str(cube["path"]), safe="")
    times = [str(moment)[:19] for moment in cube["data"]["time"].values]

    def query(step):
        return f"url={url}&variable=flux&sel=time%3D{urllib.parse.quote(times[step])}"

    def path(z, x, y, instant, step):
        del instant
        return f"/tiles/WebMercatorQuad/{z}/{x}/{y}.png?{query(step)}&rescale=-5,5&colormap_name=rdbu_r"

    def value(lon, lat, step):
        answer = json.loads(get(port, f"/point/{lon},{lat}?{query(step)}"))
        return answer["values"][0]

    wait_for(port, "/healthz")
    return {"name": f"titiler-xarray, {options.workers} workers", "port": port, "process": process, "path": path, "value": value}


def get(port, path):
    with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=60) as answer:
        return answer.read()


def wait_for(port, path):
    end = time.time() + 120
    while True:
        try:
            get(port, path)
            return
        except OSError as error:
            if time.time() > end:
                sys.exit(f"the server at {port} does not answer: {error}")
            time.sleep(0.2)


def measured(server, cube, options):
    """Values and masks of a server, then its rate."""
    chance = random.Random(SEED)
    flux = cube["data"]["flux"]
    places = []
    while len(places) < 40:
        step = chance.randrange(flux.sizes["time"])
        row = chance.randrange(flux.sizes["lat"])
        col = chance.randrange(flux.sizes["lon"])
        if bool(flux[step, row, col].notnull()):
            places.append((float(flux["lon"][col]), float(flux["lat"][row]), step))
    values = [server["value"](*place) for place in places]
    with tempfile.TemporaryDirectory() as folder:
        paths = Path(folder) / "paths"
        paths.write_text("\n".join(questions(server, flux, chance)))
        ask(server, paths, options, seconds=3)
        # Others than those that it was warmed up with.
        paths.write_text("\n".join(questions(server, flux, chance)))
        say(f"asking {server['name']} for {options.seconds} s")
        figures = ask(server, paths, options, options.seconds)
    return {"name": server["name"], "values": values, "places": places, **figures}


def questions(server, flux, chance):
    times = flux["time"].values.astype("datetime64[ms]").astype("int64")
    for _ in range(20_000):
        instant = chance.randrange(int(times[0]), int(times[-1]))
        step = chance.randrange(len(times))
        yield server["path"](ZOOM, chance.choice(COLS), chance.choice(ROWS), iso(instant), step)


def iso(instant_ms):
    seconds, ms = divmod(instant_ms, 1000)
    return time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(seconds)) + f".{ms:03}Z"


def ask(server, paths, options, seconds):
    script = Path(__file__).with_name("questions.lua")
    done = subprocess.run(
        ["wrk", "-t1", f"-c{options.clients}", f"-d{seconds}s", "--timeout", "60s", "-s", script, f"http://127.0.0.1:{server['port']}"],
        env={**os.environ, "PATHS": str(paths)},
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        sys.exit(f"wrk: {done.stderr}")
    figures = json.loads(done.stdout.splitlines()[-1])
    if figures["bad"]:
        sys.exit(f"{server['name']}: {figures['bad']} of {figures['answers']} answers are bad")
    return figures


def compare(answers, cube):
    """Both servers tell the values that the file holds."""
    flux = cube["data"]["flux"]
    for answer in answers:
        for (lon, lat, step), value in zip(answer["places"], answer["values"]):
            expected = float(flux.sel(lon=lon, lat=lat)[step])
            if abs(value - expected) > 1e-5 * max(1.0, abs(expected)):
                sys.exit(f"{answer['name']} says {value} at {lon}, {lat}, step {step}, where the file holds {expected}")


def print_table(answers, options, source):
    ours, peer = answers
    ratio = ours["per_second"] / peer["per_second"]
    if options.json:
        keys = ["name", "per_second", "p50_ms", "p95_ms", "answers"]
        print(json.dumps({"servers": [{key: row[key] for key in keys} for row in answers], "ratio": ratio}))
        return
    rows, cols = (int(450 * SCALE / 0.25), int(615 * SCALE / 0.25))
    print(f"tiles of 256 x 256 pixels of new instants, {rows} x {cols} cells, {DAYS} steps, {options.clients} clients, {os.cpu_count()} cores, equal values")
    print(f"{'server':28} {'tiles/s':>9} {'p50 ms':>9} {'p95 ms':>9}")
    for row in answers:
        print(f"{row['name']:28} {row['per_second']:9.1f} {row['p50_ms']:9.1f} {row['p95_ms']:9.1f}")
    print(f"{'':28} {ratio:8.1f}x")


if __name__ == "__main__":
    main()
