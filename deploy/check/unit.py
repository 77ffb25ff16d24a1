"""Reads a systemd unit and says what its services could not do, or could do to each other: python unit.py UNIT.

The root file system is read-only to a service, so every folder that it writes must lie in its state directory. Services
of one machine are users of their own, and are started as often as they end. The one server that does everything is a user
that stays, so that files can be landed beside it.
"""

import sys
from pathlib import Path

# Settings that name a folder which is written.
WRITTEN = {
    "fluxglobe@": ("FLUXGLOBE_DATA", "FLUXGLOBE_SPOOL", "FLUXGLOBE_EXECUTOR_WORK", "XDG_CACHE_HOME"),
    "fluxglobe": ("FLUXGLOBE_DATA", "XDG_CACHE_HOME"),
}
# Files of secrets that a service reads.
SECRETS = {"fluxglobe@": ("FLUXGLOBE_POSTGIS_PASSWORD_FILE", "FLUXGLOBE_KAFKA_PASSWORD_FILE"), "fluxglobe": ()}


def settings(unit: Path) -> dict[str, list[str]]:
    """The values of every key of the unit, in their order."""
    found: dict[str, list[str]] = {}
    for line in unit.read_text().splitlines():
        key, equals, value = line.partition("=")
        if equals and not line.startswith("#"):
            found.setdefault(key, []).append(value)
    return found


def faults(unit: Path) -> list[str]:
    """What is wrong."""
    kind = "fluxglobe@" if unit.name.startswith("fluxglobe@") else "fluxglobe"
    service = settings(unit)
    variables = dict(pair.split("=", 1) for line in service["Environment"] for pair in line.split())
    folders = service.get("StateDirectory", [])
    if not folders:
        return [f"{unit.name} has no StateDirectory"]
    own = {f"{root}/{folder}" for root in ("%S", "/var/lib") for folder in folders[0].split()}
    found = []
    for name in WRITTEN[kind]:
        value = variables.get(name, "")
        if not any(value == folder or value.startswith(f"{folder}/") for folder in own):
            found.append(f"{unit.name} cannot write {name}={value}")
    for name in SECRETS[kind]:
        if not variables.get(name, "").startswith("%d/"):
            found.append(f"{unit.name} does not hand over {name}")
    if kind == "fluxglobe@" and not any("%i" in user for user in service.get("User", [])):
        found.append(f"{unit.name} has one user for all services")
    if kind == "fluxglobe" and (service.get("User") != ["fluxglobe"] or "DynamicUser" in service):
        found.append(f"{unit.name} has no user that can land files beside it")
    if service.get("StartLimitIntervalSec") != ["0"]:
        found.append(f"{unit.name} gives up a service that ended often")
    return found


def main() -> None:
    """Prints every fault and fails if there is one."""
    found = faults(Path(sys.argv[1]))
    for fault in found:
        print(fault)
    if found:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
