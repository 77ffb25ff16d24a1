"""The list of pictures (list.toml) in, checked entries out: what is drawn, from which data, what the page says."""

import shlex
import tomllib
from dataclasses import dataclass
from pathlib import Path

FILMS = ("mp4", "webm")
# Options that write something over a picture.
ANNOTATIONS = frozenset(
    f"--{what}" for what in "annotate legend date graticule names scale-bar height-bar source".split()
)


class Faulty(Exception):
    """A list that cannot be drawn, and why."""


@dataclass(frozen=True)
class Data:
    """A set of files that strangers can have, or have where they stand."""

    name: str
    products: tuple[str, ...]  # that it lands in
    title: str
    where: str  # it comes from, as the page says it
    terms: str  # what its authors ask of those who use it
    source: str  # how it is had: demo, fluxengine, ferret-datasets or test-data
    files: str  # pattern within its source
    profiles: tuple[str, ...]  # it is landed with, one after the other; none: found by the program
    kept: bool  # may pictures of it be in the repository?


@dataclass(frozen=True)
class Entry:
    """A picture or a film."""

    name: str
    title: str
    text: str
    words: tuple[str, ...]  # of the program, without -o
    film: str | None  # its kind, for a film
    still_s: float  # instant of a film that stands for it on the page
    data: tuple[Data, ...]
    heading: str  # of the part of the page that it stands in

    @property
    def kept(self) -> bool:
        """May it be in the repository?"""
        return all(data.kept for data in self.data)

    @property
    def picture(self) -> str:
        """Name of the picture's file: for a film, of the one that stands for it."""
        return f"{self.name}.webp"

    @property
    def files(self) -> tuple[str, ...]:
        """Names of its files, the film last."""
        return (self.picture,) if self.film is None else (self.picture, f"{self.name}.{self.film}")

    @property
    def command(self) -> str:
        """What makes it, as people type it, anywhere below the repository's root."""
        output = f"{self.name}.{self.film or 'png'}"
        return " ".join(["fluxglobe", *(shown(word) for word in self.words), "-o", output])

    @property
    def is_annotated(self) -> bool:
        """Is anything written over it?"""
        return any(word.partition("=")[0] in ANNOTATIONS for word in self.words)

    @property
    def key_frames(self) -> str | None:
        """Its file of key frames, from the repository's root."""
        return option(self.words, "--key-frames")


@dataclass(frozen=True)
class Gallery:
    """All of it."""

    data: tuple[Data, ...]
    entries: tuple[Entry, ...]


def shown(word: str) -> str:
    """A word as a shell wants it."""
    return shlex.quote(word)


def option(words: tuple[str, ...], name: str) -> str | None:
    """What is given for an option."""
    return next((words[at + 1] for at, word in enumerate(words[:-1]) if word == name), None)


def read(file: Path) -> Gallery:
    """The list, checked."""
    text = tomllib.loads(file.read_text())
    data = tuple(read_data(table) for table in text.pop("data"))
    entries = []
    for part in text.pop("part"):
        heading = take(part, "title")
        entries += [read_entry(table, heading, data) for table in part.pop("picture")]
        nothing_left(part, heading)
    nothing_left(text, str(file))
    names = [entry.name for entry in entries]
    if len(set(names)) != len(names):
        raise Faulty(f"two pictures have one name: {', '.join(sorted(names))}")
    return Gallery(data, tuple(entries))


def read_data(table: dict) -> Data:
    """One set of files."""
    name = take(table, "name")
    data = Data(
        name=name,
        products=tuple(take(table, "products", name)),
        title=take(table, "title", name),
        where=take(table, "where", name),
        terms=take(table, "terms", name),
        source=take(table, "source", name),
        files=table.pop("files", ""),
        profiles=tuple(table.pop("profiles", ())),
        kept=table.pop("kept", True),
    )
    nothing_left(table, name)
    return data


def read_entry(table: dict, heading: str, data: tuple[Data, ...]) -> Entry:
    """One picture or film."""
    name = take(table, "name")
    words = tuple(shlex.split(take(table, "command", name)))
    entry = Entry(
        name=name,
        title=take(table, "title", name),
        text=take(table, "text", name),
        words=words,
        film=table.pop("film", None),
        still_s=table.pop("still_s", 0.0),
        data=tuple(data_of(name, words, data)),
        heading=heading,
    )
    nothing_left(table, name)
    if words[:1] != ("render",) or {"-o", "--output", "--data"} & set(words):
        raise Faulty(f"{name}: a command is `render ...` without output and data")
    if (entry.film is None) == (words[1] == "animation") or entry.film not in (None, *FILMS):
        raise Faulty(f"{name}: an animation is a film ({', '.join(FILMS)}), and nothing else is")
    return entry


def data_of(name: str, words: tuple[str, ...], data: tuple[Data, ...]) -> list[Data]:
    """The sets that the products of a command come from."""
    found = []
    for word in ("--layer", "--relief", "--trails"):
        product = option(words, word)
        if product is None:
            continue
        sets = [one for one in data if product in one.products]
        if len(sets) != 1:
            raise Faulty(f"{name}: {word} {product} is a product of {len(sets)} sets of data, of one it should be")
        found += [one for one in sets if one not in found]
    if not found:
        raise Faulty(f"{name}: the command names no --layer")
    return found


def take(table: dict, key: str, owner: str = "an entry") -> object:
    """A value that must be there."""
    if key not in table:
        raise Faulty(f"{owner}: {key} is missing")
    return table.pop(key)


def nothing_left(table: dict, name: str) -> None:
    """Words that nobody reads are faults."""
    if table:
        raise Faulty(f"{name}: nobody reads {', '.join(table)}")
