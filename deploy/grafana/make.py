"""Writes the dashboards for Grafana: `python make.py FOLDER`. Each panel says what it tells and when to worry."""

import sys
from pathlib import Path

import analysis
import overview
import pictures
import service
from grafana_foundation_sdk.cog.encoder import JSONEncoder


def main() -> None:
    """Writes every dashboard under its module's name."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for module in (overview, service, pictures, analysis):
        text = JSONEncoder(sort_keys=True, indent=2).encode(module.board().build())
        (folder / f"{module.__name__}.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
