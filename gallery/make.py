"""Draws the pictures of list.toml and writes docs/gallery.md, or checks that both are what the list says.

Only what is missing, or whose command, key frames or renderer changed, is drawn: what was stopped goes on from there.
"""

import argparse
import os
import re
import sys
import time
from pathlib import Path

from drawn import Drawn, Versions
from entries import Entry, Faulty, Gallery, read
from page import page

ROOT = Path(__file__).resolve().parent.parent
CACHE = Path.home() / ".cache/fluxglobe"


def say(text: str) -> None:
    """A line for people."""
    print(f"gallery: {text}", file=sys.stderr, flush=True)


def words() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="draw these, whether they changed or not")
    parser.add_argument("--all", action="store_true", help="draw everything anew")
    parser.add_argument("--page", action="store_true", help="write docs/gallery.md, draw nothing")
    parser.add_argument("--check", action="store_true", help="check docs/gallery.md and docs/gallery, draw nothing")
    parser.add_argument("--list", type=Path, default=ROOT / "gallery/list.toml", help="the list that --check goes by")
    parser.add_argument("--job", type=Path, default=ROOT / "contract/src/job.rs", help="names the renderer's version")
    parser.add_argument(
        "--annotation", type=Path, default=ROOT / "contract/src/annotation.rs", help="names the version of annotations"
    )
    parser.add_argument("--work", type=Path, default=CACHE / "gallery", help="keeps data and pictures as drawn")
    asked = parser.parse_args()
    if not asked.check and asked.list != parser.get_default("list"):
        parser.error("another --list than the repository's is only checked, never drawn")
    for name in ("job", "annotation"):
        if not asked.check and getattr(asked, name) != parser.get_default(name):
            parser.error(f"by another --{name} than the repository's is only checked, never drawn")
    return asked


def check(gallery: Gallery, docs: Path, versions: Versions) -> list[str]:
    """What is not as the list says, or as these versions of what draws draw it."""
    written = docs / "gallery.md"
    found = []
    if not written.exists() or written.read_text() != page(gallery):
        found.append(f"{written.name} is not what the list gives: make gallery ARGS=--page")
    drawn = Drawn(docs / "gallery", ROOT)
    for entry in gallery.entries:
        if entry.kept:
            found += drawn.faults(entry, versions)
    named = {name for entry in gallery.entries if entry.kept for name in entry.files} | {drawn.file.name}
    there = drawn.folder.iterdir() if drawn.folder.is_dir() else ()
    found += [f"the list does not name {file.name}" for file in there if file.name not in named]
    return found + drawn.sizes(gallery) + readme_faults(gallery, (docs.parent / "README.md").read_text())


def readme_faults(gallery: Gallery, text: str) -> list[str]:
    """Pictures and commands of the README that are not those of the list."""
    commands = {entry.name: entry.command for entry in gallery.entries}
    files = {name for entry in gallery.entries if entry.kept for name in entry.files}
    shown = re.findall(r"docs/gallery/([\w.-]+)", text)
    found = [f"README.md shows {name}, which the list does not" for name in shown if name not in files]
    for written in re.findall(r"`(fluxglobe render [^`]*)`", text):
        command = " ".join(written.split())
        name = Path(command.rpartition(" -o ")[2]).stem
        if name in commands and command != commands[name]:
            found.append(f"README.md draws {name} with another command than the list: {commands[name]}")
    return found


def records(docs: Path, work: Path) -> dict[bool, Drawn]:
    """What has been drawn: of what is kept in the repository, and of what is not."""
    return {True: Drawn(docs / "gallery", ROOT), False: Drawn(work / "not-kept", ROOT)}


def to_draw(gallery: Gallery, asked: argparse.Namespace, drawn: dict[bool, Drawn]) -> list[Entry]:
    """The entries that are drawn now."""
    unknown = set(asked.names) - {entry.name for entry in gallery.entries}
    if unknown:
        raise Faulty(f"the list has no {', '.join(sorted(unknown))}")
    if asked.names:
        return [entry for entry in gallery.entries if entry.name in asked.names]
    return [e for e in gallery.entries if asked.all or not drawn[e.kept].is_current(e, asked.versions)]


def draw(gallery: Gallery, entries: list[Entry], asked: argparse.Namespace, drawn: dict[bool, Drawn]) -> list[str]:
    """Draws entries; the names of those that failed."""
    # What it takes to draw is not needed to check.
    from draw import Artist, Failed
    from sources import Sources

    program = Path(os.environ.get("FLUXGLOBE_PROGRAM", "fluxglobe")).resolve()
    cache = Path(os.environ.get("FLUXGLOBE_CACHE", CACHE / "demo"))
    anew, work = asked.all or asked.names, asked.work
    sources = Sources(program, work, cache, say)
    artist = Artist(program, sources.data, work / "pictures", ROOT, say)
    absent = sources.land_all([data for data in gallery.data if any(data in entry.data for entry in entries)])
    failed = []
    for number, entry in enumerate(entries, start=1):
        where = f"{number} of {len(entries)}: {entry.name}"
        reasons = [absent[data.name] for data in entry.data if data.name in absent]
        if reasons:
            say(f"{where} is left out: {'; '.join(reasons)}")
            failed += [entry.name] if entry.kept else []
            continue
        say(f"{where}: {entry.command}")
        started, record = time.monotonic(), drawn[entry.kept]
        if anew:
            artist.forget(entry)
        try:
            artist.draw(entry, record.folder, record.key(entry, asked.versions))
        except Failed as reason:
            say(f"{where} FAILED: {reason}")
            failed.append(entry.name)
            continue
        record.note(entry, asked.versions)
        sizes = ", ".join(f"{name} {(record.folder / name).stat().st_size // 1000} kB" for name in entry.files)
        say(f"{where}: {time.monotonic() - started:.0f} s, {sizes}")
    return failed


def make(gallery: Gallery, asked: argparse.Namespace, docs: Path) -> int:
    """Draws, and writes the page; 0 if all is well."""
    drawn = records(docs, asked.work)
    for name in drawn[True].forget_others(gallery):
        say(f"{name} is not in the list any more and was removed")
    failed = []
    if not asked.page:
        entries = to_draw(gallery, asked, drawn)
        say(f"{len(entries)} of {len(gallery.entries)} to draw")
        failed = draw(gallery, entries, asked, drawn) if entries else []
    (docs / "gallery.md").write_text(page(gallery))
    if failed:
        say(f"FAILED: {', '.join(failed)}; the others are there, and `make gallery` goes on with these")
        return 1
    return complain(check(gallery, docs, asked.versions))


def complain(faults: list[str]) -> int:
    """Says what is wrong; 0 if nothing is."""
    for fault in faults:
        say(fault)
    return 1 if faults else 0


def main() -> int:
    """Does what is asked; 0 if all is well."""
    asked = words()
    docs = ROOT / "docs"
    try:
        gallery = read(asked.list)
        asked.versions = Versions.read(asked.job, asked.annotation)
        if asked.check:
            return complain(check(gallery, docs, asked.versions))
        return make(gallery, asked, docs)
    except Faulty as fault:
        say(str(fault))
        return 2
    except KeyboardInterrupt:
        say("stopped; `make gallery` goes on from here")
        return 130


if __name__ == "__main__":
    sys.exit(main())
