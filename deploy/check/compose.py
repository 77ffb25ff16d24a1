"""Reads `docker compose config --format json` and says what our own rules for the compose file find wrong."""

import json
import sys


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
    found += spool_faults(service)
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
