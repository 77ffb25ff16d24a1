"""Statistics of a polygon on a Ballista cluster of 1, 2, 4 and 8 executors, one processor each, all on this machine.

The made-up China Sea (`fluxglobe generate china-sea --years N`, 450 x 615 cells a day) is landed, and questions that read every
value of a polygon are asked of `fluxglobe serve` over HTTP: of some 46,000 cells, and of all of the sea with percentiles by month, in several
passes. Every question is a new one, by a polygon that was not asked for before. Answers of any number of executors are compared
with those of a server without a cluster first, bit by bit.

A machine with at least one processor an executor and two more says something; on a smaller one the figures are told with that.

    make bench ARGS="executors"        # 16 years need 13 GB of disk
    make bench ARGS="executors --years 2 --executors 1,2"
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import stats
import tiles

REPEATS = 3
# Executors report what they are done with, and ask for more, this often; nothing is quicker.
POLL_S = 0.05


def main():
    options = arguments()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        folder = Path(options.data or folder)
        folder.mkdir(parents=True, exist_ok=True)
        product = data(options, folder)
        rows = []
        for name, words, shape in questions():
            tiles.say(name)
            asked = [{**words, "region": text} for text in shape]
            alone = answers(options, folder, product, asked, {})
            row = {"question": name, "in_process_s": median([seconds for seconds, _ in alone]), "executors": {}}
            for count in options.executors:
                with Cluster(options, folder, count) as cluster:
                    found = answers(options, folder, product, asked, cluster.settings)
                for (_, right), (_, other) in zip(alone, found):
                    if right != other:
                        sys.exit(f"{name}: {count} executors answer otherwise than one process")
                row["executors"][count] = median([seconds for seconds, _ in found])
            rows.append(row)
        print_table(rows, options)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True, help="the fluxglobe to measure")
    parser.add_argument("--years", type=int, default=16, help="years of days")
    parser.add_argument("--executors", type=lambda text: [int(one) for one in text.split(",")], default=[1, 2, 4, 8], help="how many, one after the other")
    parser.add_argument("--folder", help="where temporary files are made")
    parser.add_argument("--data", help="folder that keeps what was made and landed, for another run")
    parser.add_argument("--json", action="store_true", help="figures as JSON")
    return parser.parse_args()


def data(options, folder):
    """Lands the files, once."""
    told = folder / "builds.json"
    if told.exists():
        return json.loads(told.read_text())["product"]
    tiles.say(f"making {options.years} years of the China Sea")
    files = stats.made(options.program, options.years, folder)
    tiles.say("landing them")
    tiles.run(options.program, "--data", folder / "data", "ingest", *files)
    listed = json.loads(tiles.run(options.program, "--data", folder / "data", "products", "--json"))
    product = next(row["product"] for row in listed if not row["product"].endswith("-accumulated"))
    told.write_text(json.dumps({"product": product, "builds": []}))
    return product


def questions():
    """Names, words and polygons of what is asked: what stored sums know is not among it."""

    def polygon(ring):
        return "POLYGON((" + ",".join(f"{x} {y}" for x, y in [*ring, ring[0]]) + "))"

    sums = {"statistic": "mean,std,min,max", "step": "native"}
    some = [polygon(stats.outline(0.017 * at)) for at in range(REPEATS)]
    yield "46,000 cells: mean, deviation, extremes of every day", sums, some
    corners = [(100.1, 0.1), (115, 0.1), (129.9, 0.1), (129.9, 29.9), (100.1, 29.9)]
    whole = [polygon([(x + 0.013 * at, y + 0.011 * at) for x, y in corners]) for at in range(REPEATS)]
    yield "all cells: mean, deviation, extremes of every day", sums, whole
    yield "all cells: p5, median, p95 of every month", {"statistic": "p5,median,p95", "step": "month"}, whole


def answers(options, folder, product, asked, settings):
    """Seconds of each question to a server, over HTTP, and what it answered."""
    os.environ.update(settings)
    server = stats.Ours(options, folder, product)
    for name in settings:
        del os.environ[name]
    try:
        # The first question opens the version, on every executor too.
        server.ask("area", "json", **{**asked[0], "region": "110,10,111,11"})
        return [server.ask("area", "json", **own) for own in asked]
    finally:
        server.stop()


class Cluster:
    """A scheduler and so many executors, each a process with one place for a task."""

    def __init__(self, options, folder, count):
        self.options, self.folder, self.count = options, folder, count
        self.processes = []

    def __enter__(self):
        port = tiles.free_port()
        self.settings = {"FLUXGLOBE_CLUSTER": f"http://127.0.0.1:{port}"}
        admin = tiles.free_port()
        # Nothing lands: the scheduler works without its event log, which it waits for.
        self.start("scheduler", "--scheduler-listen", f"127.0.0.1:{port}", "--admin", f"127.0.0.1:{admin}", "--kafka", "127.0.0.1:9")
        work = tempfile.mkdtemp(dir=self.options.folder)
        for number in range(self.count):
            self.start(
                "executor", "--executor-name", f"e{number}", "--executor-tasks", 1, "--executor-work", work,
                "--executor-listen", f"127.0.0.1:{tiles.free_port()}", "--admin", f"127.0.0.1:{tiles.free_port()}",
            )  # fmt: skip
        end = time.time() + 60
        wanted = f"fluxglobe_scheduler_executors {self.count}"
        while True:
            try:
                metrics = tiles.get(admin, "/metrics").decode()
            except OSError:
                metrics = ""
            if wanted in metrics:
                return self
            if time.time() > end:
                sys.exit(f"{self.count} executors did not come up:\n{metrics[-2000:]}")
            time.sleep(POLL_S)

    def start(self, *words):
        store = f"file:{self.folder / 'data' / 'objects'}"
        command = [str(self.options.program), *map(str, words)]
        environment = {**os.environ, "FLUXGLOBE_STORE": store, **(self.settings if words[0] == "executor" else {})}
        # An executor has a core of its own, as in a pod of one, as long as there are so many; scheduler and command have the last two processors.
        processors = by_core()
        number = len(self.processes)
        own = {processors[(number - 1) % len(processors)]} if number > 0 else set(processors[-2:])

        def pinned():
            os.sched_setaffinity(0, own)

        self.processes.append(subprocess.Popen(command, env=environment, preexec_fn=pinned, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))

    def __exit__(self, *_error):
        for process in self.processes:
            process.kill()
        for process in self.processes:
            process.wait()


def by_core():
    """Processors that may be used: one of each core, then those that share a core with one of these."""

    def core(processor):
        topology = Path(f"/sys/devices/system/cpu/cpu{processor}/topology")
        try:
            return tuple(int((topology / name).read_text()) for name in ("physical_package_id", "core_id"))
        except (OSError, ValueError):
            return processor

    seen, first, others = set(), [], []
    for processor in sorted(os.sched_getaffinity(0)):
        (others if core(processor) in seen else first).append(processor)
        seen.add(core(processor))
    return first + others


def median(values):
    return sorted(values)[len(values) // 2]


def print_table(rows, options):
    if options.json:
        print(json.dumps({"processors": os.cpu_count(), "rows": rows}, indent=1))
        return
    print(f"{os.cpu_count()} processors, {options.years} years of days, 450 x 615 cells; seconds over HTTP")
    print(f"{'question':<58} {'in process':>10} " + " ".join(f"{count:>14}" for count in options.executors))
    for row in rows:
        one = row["executors"][options.executors[0]]
        figures = [f"{seconds:.2f} ({one / seconds:.1f} x)" for seconds in row["executors"].values()]
        print(f"{row['question']:<58} {row['in_process_s']:>10.2f} " + " ".join(f"{figure:>14}" for figure in figures))


if __name__ == "__main__":
    main()
