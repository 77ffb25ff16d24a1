"""Are all metrics that rules and dashboards ask for ones that the program has? python metrics.py SOURCES FILE...

The program puts a name together from `fluxglobe`, a service and what is measured; each part stands in its source as a
string. A part that stands nowhere belongs to a metric that nobody counts.
"""

import re
import subprocess
import sys
from pathlib import Path

# What Prometheus makes of a histogram, and what the rules themselves record.
SUFFIX = re.compile(r"_(bucket|count|sum)$")
NAME = re.compile(r"(?<![:a-z_])fluxglobe_[a-z0-9_]+")
# One name a service in the dashboard of a service.
ANY_SERVICE = "${service}"


def strings(folder: str) -> set[str]:
    """Every string in the Rust sources."""
    listed = subprocess.run(
        ["git", "-C", folder, "ls-files", "--cached", "--others", "--exclude-standard", "*.rs"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout.split()
    found = set()
    for file in filter(lambda file: (Path(folder) / file).exists(), listed):
        text = (Path(folder) / file).read_text().replace("'\"'", "")
        found.update(re.findall(r'"((?:[^"\\]|\\.)*)"', text, re.DOTALL))
    return found


def is_counted(name: str, known: set[str]) -> bool:
    """Is it written out, or put together from a service and what it measures?"""
    if name in known:
        return True
    parts = name.removeprefix("fluxglobe_").split("_")
    return any(
        "_".join(parts[at:]) in known
        and ("_".join(parts[:at]) in known or f"fluxglobe_{'_'.join(parts[:at])}_{{what}}" in known)
        for at in range(1, len(parts))
    )


def main() -> None:
    """Prints the names that stand nowhere and fails if there is one."""
    # Names of metrics end in what is measured: `requests_total` is written `fluxglobe_{service}_requests_total` too.
    known = {text.rsplit("}_", 1)[-1] for text in strings(sys.argv[1])} | strings(sys.argv[1])
    wanted = set()
    for file in map(Path, sys.argv[2:]):
        names = NAME.findall(file.read_text().replace(ANY_SERVICE, "ingestd"))
        # A gauge may be called a count too.
        wanted |= {name if name in known else SUFFIX.sub("", name) for name in names}
    missing = sorted(name for name in wanted if not is_counted(name, known))
    for name in missing:
        print(f"no service counts {name}")
    if missing or not wanted:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
