"""Makes Kubernetes' JSON schemas readable without the internet: python schemas.py FROM TO.

They name each other by web addresses; here they become files in one folder.
"""

import json
import sys
from pathlib import Path


def main() -> None:
    """Writes every schema of one folder into the other."""
    source, target = map(Path, sys.argv[1:])
    target.mkdir(parents=True)
    files = sorted(source.glob("*.json"))
    if not files:
        raise SystemExit(f"no schemas in {source}")
    for file in files:
        schema = json.loads(file.read_text())
        schema.pop("$id", None)
        text = json.dumps(schema).replace("/api/_definitions.json", "_definitions.json")
        (target / file.name).write_text(text)


if __name__ == "__main__":
    main()
