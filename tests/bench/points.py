"""A point's series over many years, before and after steps are laid out by time: `fluxglobe serve` over HTTP, one machine, in one run.

The made-up China Sea (`fluxglobe generate china-sea --years N`, 450 x 615 cells a day) is landed. Its store is copied by hard links
without its cube; `migrate` makes the cube again from the fields and is killed when all steps are in it and none is laid out by time
yet. That is what a server finds just after files came. Then the same points are asked of both stores, each at a place that was
not asked for before, files in the page cache; answers must be the same bytes.

    make bench ARGS="points --data FOLDER"       # the folder of `stats --data` may be used again
    make bench ARGS="points --years 2"
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import executors
import stats
import tiles

POINTS = 9
# Between two looks at what is there already.
PAUSE_S = 0.005


def main():
    options = arguments()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        folder = Path(options.data or folder)
        folder.mkdir(parents=True, exist_ok=True)
        product = executors.data(options, folder)
        before = folder / "uncompacted"
        shutil.rmtree(before, ignore_errors=True)
        try:
            followed(options, folder / "data", before / "data", product)
            # The first question after a start opens the cube.
            asked = {"before": asked_of(options, before, product), "after": asked_of(options, folder, product)}
        finally:
            shutil.rmtree(before, ignore_errors=True)
    if asked["before"]["answers"] != asked["after"]["answers"]:
        sys.exit("points are answered otherwise once they are laid out by time")
    rows = [{"when": when, "first_ms": own["ms"][0], "median_ms": sorted(own["ms"][1:])[len(own["ms"][1:]) // 2]} for when, own in asked.items()]
    if options.json:
        print(json.dumps(rows, indent=1))
        return
    print(f"{os.cpu_count()} processors, {options.years} years of days, a point, Arrow over HTTP")
    print(f"{'steps laid out by time':<26}{'first after a start':>22}{'median of others':>20}")
    for row in rows:
        when = {"before": "not yet", "after": "yes"}[row["when"]]
        print(f"{when:<26}{row['first_ms']:>19.1f} ms{row['median_ms']:>17.1f} ms")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True, help="the fluxglobe to measure")
    parser.add_argument("--years", type=int, default=16, help="years of days")
    parser.add_argument("--folder", help="where temporary files are made")
    parser.add_argument("--data", help="folder that keeps what was made and landed, for another run")
    parser.add_argument("--json", action="store_true", help="figures as JSON")
    return parser.parse_args()


def followed(options, landed, copy, product):
    """A copy of a store whose cube has all steps, and none of them by time."""
    copy.mkdir(parents=True)
    shutil.copytree(landed / "events", copy / "events")
    for kind in (landed / "objects").iterdir():
        if kind.name != "cubes":
            shutil.copytree(kind, copy / "objects" / kind.name, copy_function=os.link)
    tiles.say("making its cube again")
    words = [options.program, "--data", copy, "migrate", "--product", product]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    cube = copy / "objects" / "cubes" / product
    while process.poll() is None:
        # An empty state, that of the version, and its name, which is the last change of `repo`.
        states = sorted((cube / "snapshots").glob("*"), key=lambda state: state.stat().st_ctime) if cube.exists() else []
        states = [state for state in states if "#" not in state.name]
        if len(states) > 1 and (cube / "repo").stat().st_ctime > states[1].stat().st_ctime:
            break
        time.sleep(PAUSE_S)
    process.send_signal(signal.SIGKILL)
    process.wait(timeout=60)
    count = len([state for state in (cube / "snapshots").glob("*") if "#" not in state.name])
    if count != 2:
        sys.exit(f"{count} states are there where an empty one and that of the version belong: some steps may lie by time")


def asked_of(options, folder, product):
    server = stats.Ours(options, folder, product)
    try:
        # Files into the page cache; what a server remembers goes with it.
        server.ask("point", "arrow", lat=18.0, lon=118.0)
        server.stop()
        server.start()
        ms, answers = [], []
        for at in range(POINTS):
            place = {"lat": 10.05 + 0.9 * at, "lon": 112.05 + 0.7 * at}
            seconds, _ = server.ask("point", "arrow", **place)
            ms.append(seconds * 1000)
            _, text = server.ask("point", "csv", **place)
            answers.append(text)
        return {"ms": ms, "answers": answers}
    finally:
        server.stop()


if __name__ == "__main__":
    main()
