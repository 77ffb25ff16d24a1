#!/usr/bin/env python3
"""Builds every test of the workspace and runs it, and ends with 0 if all of it is in order.

    tests/run.py [SUITE...]         suites by name, such as `kafka-log/it` or `tests/cluster`; all of them if none is named
    tests/run.py --build            builds them, with the programs that they run, and runs none

What is built is compiled by clippy's driver, which is the compiler with its lints: where lints are a check of their own, as `make
check` is, every dependency is compiled once more for it. So code that they refuse does not build. Suites that mostly wait, for
servers or for processes that were killed, go one after the other beside those that compute. What a suite says is shown when it
ends. A suite that fails hides no other.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time

# Suites that mostly wait, longest last.
WAITING = ["observations/it", "storage/it", "kafka-log/it", "tests/cluster"]
CARGO = os.environ.get("CARGO", "cargo")
# What `cargo clippy -- -D warnings` tells cargo when it checks.
LINTED = {"RUSTC_WORKSPACE_WRAPPER": "clippy-driver", "CLIPPY_ARGS": "-Dwarnings__CLIPPY_HACKERY__"}
TARGETS = ["--locked", "--workspace", "--lib", "--bins", "--tests"]
ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
# How much of what a failed suite said is shown once more at the end, where people look first.
LAST_LINES = 60
# A suite that says nothing more is ended and has failed: what waits for ever must not take the others' words with it. The
# longest takes a quarter of this on two cores.
LIMIT_S = 1800
shown = threading.Lock()
# Suites under way, each leading a group of all that it started.
under_way = set()


def build():
    """Builds everything; tells what failed by its exit code."""
    # Examples, which no test runs, are there for the lints.
    return subprocess.run([CARGO, "build", *TARGETS, "--examples"], cwd=ROOT, env={**os.environ, **LINTED}, check=False).returncode


def suites():
    """Test programs by name: path, folder that they run in, and whether they hold tests of binaries or libraries."""
    messages = subprocess.run(
        [CARGO, "test", "--no-run", *TARGETS, "--message-format=json-render-diagnostics"],
        cwd=ROOT,
        env={**os.environ, **LINTED},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout
    found = {}
    for line in messages.splitlines():
        message = json.loads(line)
        if not message.get("executable") or not message.get("profile", {}).get("test"):
            continue
        folder = os.path.dirname(message["manifest_path"])
        package = message["package_id"].split("#")[-1].split("@")[0]
        if "#" not in message["package_id"] or package[0].isdigit():
            package = os.path.basename(folder)
        kind = message["target"]["kind"][0]
        target = message["target"]["name"]
        name = f"{package}/{target}" if kind == "test" else f"{package}/{kind}:{target}"
        again = {"test": f"--test {target}", "bin": f"--bin {target}"}.get(kind, "--lib")
        found[name] = (message["executable"], folder, f"cargo test -p {package} {again}")
    return found


def end(suite):
    """Ends a suite with all that it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(suite.pid, signal.SIGKILL)


def run(name, command, folder, again, results, **more):
    """Runs one suite, shows what it said, and notes how it ended and its last words."""
    start = time.monotonic()
    environment = {**os.environ, **more}
    suite = subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    under_way.add(suite)
    try:
        said, _ = suite.communicate(timeout=LIMIT_S)
    except subprocess.TimeoutExpired:
        end(suite)
        said, _ = suite.communicate()
        said += f"\nended after {LIMIT_S} s: it had not come to an end\n"
    under_way.discard(suite)
    seconds = time.monotonic() - start
    with shown:
        print(f"\n===== {name}: {' '.join(command)}", flush=True)
        print(said, flush=True)
    results.append((name, suite.returncode, seconds, again, said.splitlines()[-LAST_LINES:]))


def end_all(number, _frame):
    """Whoever ends this ends what it started."""
    for suite in list(under_way):
        end(suite)
    os._exit(128 + number)


def lane(names, found, results):
    for name in names:
        program, folder, again = found[name]
        # What cargo tells a test program. Cargo itself must not hear it: build scripts would run anew.
        run(name, [program], folder, again, results, CARGO=CARGO, CARGO_MANIFEST_DIR=folder)


def main():
    if sys.argv[1:] == ["--build"]:
        sys.exit(build())
    found = suites()
    wanted = sys.argv[1:] or list(found)
    unknown = [name for name in [*wanted, *WAITING] if name not in found]
    if unknown:
        sys.exit(f"no such suite: {', '.join(unknown)}; there are {', '.join(sorted(found))}")
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, end_all)
    results = []
    lanes = [
        [name for name in WAITING if name in wanted],
        [name for name in wanted if name not in WAITING],
    ]
    threads = [threading.Thread(target=lane, args=(names, found, results)) for names in lanes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print("\n===== all suites")
    for name, code, seconds, *_ in sorted(results, key=lambda result: -result[2]):
        print(f"{seconds:7.1f} s  {'ok' if code == 0 else 'FAILED'}  {name}")
    failed = [(name, again, last_words) for name, code, _, again, last_words in results if code != 0]
    # A thread that died has said why above, and took what was to follow it along.
    ended = {name for name, *_ in results}
    failed += [(name, found[name][2], ["it was not run"]) for name in wanted if name not in ended]
    for name, again, last_words in failed:
        print(f"\n===== why {name} failed", *last_words, sep="\n")
        print(f"again: deploy/with-services.sh {again}")
    sys.exit(1 if failed else 0)


main()
