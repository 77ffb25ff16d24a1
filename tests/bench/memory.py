"""Jobs over values that are many times larger than the memory they may take: what they take at most, and how long they last.

The made-up China Sea (`fluxglobe generate china-sea --years N`, 450 x 615 cells a day) is landed, 6.5 GB of values in 16 years, and
each job is a command with `--memory-mib`. Told are the highest resident memory of the process, which has the program, what it
remembers and the pages of files that it has mapped in it, and that answers are those of a process with more.

    make bench ARGS="memory --data FOLDER"       # the folder of `stats --data` may be used again
    make bench ARGS="memory --years 2 --memory-mib 64"
"""

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import executors
import stats
import tiles

ROOMY_MIB = 2048
NAME = "bench-memory"


def main():
    options = arguments()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        folder = Path(options.data or folder)
        folder.mkdir(parents=True, exist_ok=True)
        product = executors.data(options, folder)
        rows = []
        for name, words in jobs(product):
            tiles.say(name)
            found = [ran(options, folder, mib, words) for mib in (options.memory_mib, ROOMY_MIB)]
            # Maps that were derived for this alone.
            for made in (folder / "data" / "objects").glob(f"*/{NAME}-*"):
                shutil.rmtree(made)
            if found[0]["output"] != found[1]["output"]:
                sys.exit(f"{name}: another answer with {options.memory_mib} MiB than with {ROOMY_MIB}")
            rows.append({"job": name, "peak_mib": [one["peak_mib"] for one in found], "seconds": [one["seconds"] for one in found]})
        if options.json:
            print(json.dumps(rows, indent=1))
            return
        values = 450 * 615 * 4 * options.years * 365.25 / 2**20
        print(f"{os.cpu_count()} processors, {options.years} years of days: {values:.0f} MiB of values; highest resident memory of the command")
        print(f"{'job':<58}" + "".join(f"{f'--memory-mib {mib}':>26}" for mib in (options.memory_mib, ROOMY_MIB)))
        for row in rows:
            figures = [f"{peak:.0f} MiB, {seconds:.1f} s" for peak, seconds in zip(row["peak_mib"], row["seconds"])]
            print(f"{row['job']:<58}" + "".join(f"{figure:>26}" for figure in figures))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True, help="the fluxglobe to measure")
    parser.add_argument("--years", type=int, default=16, help="years of days")
    parser.add_argument("--memory-mib", type=int, default=64, help="memory that work may take")
    parser.add_argument("--folder", help="where temporary files are made")
    parser.add_argument("--data", help="folder that keeps what was made and landed, for another run")
    parser.add_argument("--json", action="store_true", help="figures as JSON")
    return parser.parse_args()


def jobs(product):
    """Names and words: those of maps have names of their own, for what is there is not made again."""
    names = [f"{NAME}-{int(time.time())}-{letter}" for letter in "ab"]

    def maps(*words):
        return lambda mib: ["derive", "statistic", "--product", product, *words, "--name", names[mib == ROOMY_MIB]]

    # Some 46,000 cells.
    ring = stats.outline(0.007)
    outline = "POLYGON((" + ",".join(f"{x} {y}" for x, y in [*ring, ring[0]]) + "))"
    whole = ["--region", "100.1,0.1,129.9,29.9", "--json"]
    polygon = ["stats", "polygon", "--product", product, *whole]
    yield "all cells: mean, deviation, extremes of every day", [*polygon, "--statistic", "mean,std,min,max", "--step", "native"]
    yield "all cells: p5, median, p95 of every month", [*polygon, "--statistic", "p5,median,p95", "--step", "month"]
    yield "budget by month", ["budget", "--product", product, "--step", "month", *whole]
    yield "polygon: p5, median, p95 of every month", ["stats", "polygon", "--product", product, "--region", outline, "--json", "--statistic", "p5,median,p95", "--step", "month"]
    yield "mean and deviation of every cell", maps("--statistic", "mean,spread")
    yield "p5, median, p95 of every cell of the polygon", maps("--statistic", "p5,median,p95", "--region", outline)
    yield "trend of every cell, and its significance", maps("--statistic", "trend,trend-p-value")


def ran(options, folder, mib, words):
    """Runs a command in a process of its own, which is asked for the memory of its child."""
    words = words(mib) if callable(words) else words
    command = [options.program, "--data", folder / "data", "--memory-mib", mib, *words]
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        begin = time.perf_counter()
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        seconds = time.perf_counter() - begin
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        output = made_of(folder, words[-1]) if "derive" in words else done.stdout
        told = {"failed": done.stderr[-2000:] if done.returncode else None, "output": output, "seconds": seconds, "peak_mib": peak}
        with os.fdopen(write, "w") as pipe:
            pipe.write(json.dumps(told))
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        told = json.loads(pipe.read())
    os.waitpid(child, 0)
    if told["failed"] is not None:
        sys.exit(f"{' '.join(map(str, command))}: {told['failed']}")
    return told


def made_of(folder, name):
    """What maps that were derived hold: fields are named by the digest of their values."""
    fields = (folder / "data" / "objects" / "frames").glob(f"{name}-*/**/*")
    return sorted(f"{path.parent.name.removeprefix(name)}/{path.name}" for path in fields if path.is_file())


if __name__ == "__main__":
    main()
