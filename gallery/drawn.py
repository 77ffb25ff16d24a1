"""What has been drawn: commands and digests of the files in docs/gallery, kept in drawn.json beside them."""

import hashlib
import json
import re
from dataclasses import dataclass
from pathlib import Path

from entries import Entry, Faulty, Gallery

# Largest files in the repository, bytes: of a picture, of a film, of all.
PICTURE_BYTES = 250_000
FILM_BYTES = 1_500_000
ALL_BYTES = 6_000_000


def digest(file: Path) -> str:
    """SHA-256 of a file's bytes."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


@dataclass(frozen=True)
class Versions:
    """Of what draws: of the renderer, and of what it writes over pictures."""

    renderer: int
    annotations: int

    @classmethod
    def read(cls, job: Path, annotation: Path) -> "Versions":
        """Those that two files of the source name."""
        return cls(named(job, "RENDERER_VERSION"), named(annotation, "ANNOTATION_VERSION"))

    def of(self, entry: Entry) -> dict[str, int]:
        """Those that an entry's look depends on."""
        own = {"renderer": self.renderer}
        return {**own, "annotations": self.annotations} if entry.is_annotated else own


def named(source: Path, name: str) -> int:
    """The number that a file of the source gives a constant."""
    found = re.search(rf"{name}: u32 = (\d+);", source.read_text())
    if found is None:
        raise Faulty(f"{source} names no {name}")
    return int(found[1])


class Drawn:
    """The record of one folder of pictures."""

    def __init__(self, folder: Path, root: Path) -> None:
        self.folder = folder
        self.root = root
        self.file = folder / "drawn.json"
        self.record: dict[str, dict] = json.loads(self.file.read_text()) if self.file.exists() else {}

    def asked(self, entry: Entry) -> dict:
        """What makes an entry what it is, but for the data and the renderer."""
        frames = entry.key_frames
        inputs = {} if frames is None else {frames: digest(self.root / frames)}
        return {"command": entry.command, "inputs": inputs}

    def key(self, entry: Entry, versions: Versions) -> str:
        """Names what an entry is drawn from, but for the data."""
        text = json.dumps([self.asked(entry), versions.of(entry)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def faults(self, entry: Entry, versions: Versions) -> list[str]:
        """Why an entry's files are not what its command makes with these versions of what draws."""
        held = self.record.get(entry.name)
        if held is None:
            return [f"{entry.name} has not been drawn"]
        asked = self.asked(entry)
        if held["command"] != asked["command"]:
            return [f"{entry.name} was drawn by another command: {held['command']}"]
        if held["inputs"] != asked["inputs"]:
            return [f"{entry.name} was drawn with other key frames than {entry.key_frames} has now"]
        for what, version in versions.of(entry).items():
            if held.get(what) != version:
                own = held.get(what, "unknown")
                return [f"{entry.name} was drawn by {what} version {own}, not {version}: make gallery"]
        found = []
        for name in entry.files:
            file = self.folder / name
            if not file.exists():
                found.append(f"{name} is missing")
            elif held["files"].get(name) != digest(file):
                found.append(f"{name} is not the file that was drawn")
        return found

    def is_current(self, entry: Entry, versions: Versions) -> bool:
        """Is there nothing to draw?"""
        return not self.faults(entry, versions)

    def note(self, entry: Entry, versions: Versions) -> None:
        """Takes in that an entry's files have just been drawn."""
        files = {name: digest(self.folder / name) for name in entry.files}
        self.record[entry.name] = {**self.asked(entry), **versions.of(entry), "files": files}
        self.write()

    def forget_others(self, gallery: Gallery) -> list[str]:
        """Removes what the list does not name any more, files too; their names."""
        names = {entry.name for entry in gallery.entries}
        gone = sorted(set(self.record) - names)
        for name in gone:
            for file in self.record.pop(name)["files"]:
                (self.folder / file).unlink(missing_ok=True)
        if gone:
            self.write()
        return gone

    def write(self) -> None:
        """Keeps the record."""
        self.folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(self.record, indent=1, sort_keys=True)
        self.file.write_text(text + "\n")

    def sizes(self, gallery: Gallery) -> list[str]:
        """What is too large for a repository."""
        kept = [entry for entry in gallery.entries if entry.kept]
        sizes = {n: (self.folder / n).stat().st_size for e in kept for n in e.files if (self.folder / n).exists()}
        most = {name: PICTURE_BYTES if name.endswith(".webp") else FILM_BYTES for name in sizes}
        found = [f"{n} has {size} bytes, at most {most[n]} are kept" for n, size in sizes.items() if size > most[n]]
        if sum(sizes.values()) > ALL_BYTES:
            found.append(f"all files have {sum(sizes.values())} bytes, at most {ALL_BYTES} are kept")
        return found
