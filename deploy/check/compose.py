"""Reads `docker compose config --format json` and says what our own rules for the compose file find wrong."""

import json
import sys


GIB = 1 << 30
MIB = 1 << 20
# What a tile server holds at most besides what can be set: values of /zarr (tile-server/src/cubes.rs), geometries
# (bodies.rs), two large pictures that are put together, the program and what it remembers.
TILE_SERVER_BYTES = 1 * GIB + 256 * MIB + 2 * 270 * 10**6 + 200 * MIB


def memory_faults(service: dict) -> list[str]:
    """What is wrong with the end of a process's memory beside the bounds that it keeps to by itself."""
    environment = service.get("environment") or {}
    limit_bytes = int(service.get("deploy", {}).get("resources", {}).get("limits", {}).get("memory", 0))
    match service.get("command"):
        case ["tile-server"]:
            questions_bytes = int(environment.get("FLUXGLOBE_MEMORY_MIB", 1024)) * MIB
            pictures_bytes = int(environment.get("FLUXGLOBE_TILE_MEMORY_BYTES", 256 * MIB))
            wanted_bytes = TILE_SERVER_BYTES + questions_bytes + pictures_bytes
        case ["executor"]:
            wanted_bytes = 2 * int(environment.get("FLUXGLOBE_EXECUTOR_MEMORY_BYTES", 4 * GIB))
        case _:
            return []
    if limit_bytes >= wanted_bytes:
        return []
    return [f"may hold {wanted_bytes} bytes by its own bounds and is ended at {limit_bytes}"]


def spool_faults(service: dict) -> list[str]:
    """What is wrong with where files lie that are on their way to the store: a volume, which is a disk, and not /tmp, which is memory."""
    environment = service.get("environment") or {}
    if "FLUXGLOBE_STORE" not in environment:
        return []
    folder = environment.get("TMPDIR") or "/tmp"
    volumes = [volume["target"] for volume in service.get("volumes", []) if volume["type"] == "volume"]
    if any(folder == volume or folder.startswith(f"{volume}/") for volume in volumes):
        return []
    return [f"spools large fields in {folder}, which is no volume"]


def faults(name: str, service: dict) -> list[str]:
    """What is wrong with one service."""
    found = []
    for port in service.get("ports", []):
        if port.get("host_ip") != "127.0.0.1":
            found.append(f"publishes port {port.get('published')} to more than this machine")
    if ":" not in service["image"] or service["image"].endswith(":latest"):
        found.append(f"image {service['image']} has no version")
    if "no-new-privileges:true" not in service.get("security_opt", []):
        found.append("may gain privileges")
    if not service.get("deploy", {}).get("resources", {}).get("limits", {}).get("memory"):
        found.append("has no end to its memory")
    if "healthcheck" not in service and name not in ("bucket", "topics"):
        found.append("has no health check")
    if service["image"].startswith("fluxglobe:") and not service.get("read_only"):
        found.append("has a writable root file system")
    found += spool_faults(service) + memory_faults(service)
    return [f"{name} {fault}" for fault in found]


def main() -> None:
    """Prints every fault and fails if there is one."""
    services = json.load(sys.stdin)["services"]
    found = [fault for name, service in sorted(services.items()) for fault in faults(name, service)]
    for fault in found:
        print(f"compose.yaml: {fault}")
    if found or not services:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
