"""Prints the dashboards' PromQL as a rule file, so that promtool can judge it: python queries.py DASHBOARD.json..."""

import json
import re
import sys
from pathlib import Path

# What Grafana puts in where a query is asked.
FILLED_IN = {"$__rate_interval": "5m", "${service}": "ingestd"}


def queries(dashboard: dict) -> list[str]:
    """Every expression of a dashboard."""
    found = [target["expr"] for panel in dashboard["panels"] for target in panel.get("targets", [])]
    for name, value in FILLED_IN.items():
        found = [query.replace(name, value) for query in found]
    left = [query for query in found if re.search(r"\$", query)]
    if left:
        raise SystemExit(f"an unknown variable in {left[0]}")
    return found


def main() -> None:
    """One recording rule a query, in a group a dashboard."""
    groups = []
    for file in map(Path, sys.argv[1:]):
        rules = [
            {"record": f"panel:{file.stem}:query{index}", "expr": query}
            for index, query in enumerate(queries(json.loads(file.read_text())))
        ]
        if not rules:
            raise SystemExit(f"no query in {file}")
        groups.append({"name": file.stem, "rules": rules})
    # JSON is YAML.
    print(json.dumps({"groups": groups}))


if __name__ == "__main__":
    main()
