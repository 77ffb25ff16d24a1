"""The list in, docs/gallery.md out."""

from itertools import groupby

from entries import Data, Entry, Gallery

HEAD = """# Gallery

Written by `make gallery` from [gallery/list.toml](../gallery/list.toml): pictures and films of real data, each with the
command that drew it. `make gallery` fetches and lands the data, draws what is missing, or whose command or renderer changed
(everything with `make gallery ARGS=--all`, one with `ARGS=NAME`) and says what it does; it needs nothing but what
`make demo` needs. To draw one by hand, in the root of the repository:

```sh
export FLUXGLOBE_DATA=~/.cache/fluxglobe/gallery/data    # where `make gallery` lands the data
```

Heights are carbon: above the sea what it has given off since January, below what it has taken up, as the bar in each
picture says. Red gives off at the date of the picture, blue takes up. Pictures and frames of films are drawn without
loss and kept here in fewer bytes (WebP, H.264).
"""


def page(gallery: Gallery) -> str:
    """All of the page."""
    parts = [HEAD]
    for heading, entries in groupby(gallery.entries, lambda entry: entry.heading):
        parts.append(f"## {heading}\n")
        parts += [section(entry) for entry in entries]
    parts.append("## Where the data come from\n")
    parts.append(
        "Nobody's data are in the repository. What their authors ask is quoted from the files where they say it."
        " Relief and coast lines ask for nothing.\n"
    )
    parts.append("| data | where from | terms |\n|---|---|---|")
    parts += [row(data) for data in gallery.data]
    return "\n".join(parts) + "\n"


def section(entry: Entry) -> str:
    """One picture or film."""
    lines = [f"### {entry.title}\n"]
    if entry.kept:
        lines.append(f"{picture(entry)}\n")
    else:
        named = ", ".join(data.title for data in entry.data if not data.kept)
        lines.append(f"*Not in the repository, because of the terms of its data ({named}); drawn where they are.*\n")
    lines.append(f"{entry.text.strip()}\n")
    lines.append("Data: " + "; ".join(data.title for data in entry.data) + ".\n")
    lines.append(f"```sh\n{wrapped(entry.command)}\n```\n")
    return "\n".join(lines)


def picture(entry: Entry) -> str:
    """The picture, for a film the one that stands for it, with a link to the film."""
    image = f"![{entry.title}](gallery/{entry.picture})"
    if entry.film is None:
        return image
    film = f"gallery/{entry.name}.{entry.film}"
    return f"[{image}]({film})\n\n[The film]({film})."


def wrapped(command: str, width: int = 120) -> str:
    """A command on lines of a shell, broken before options."""
    lines, line = [], ""
    for part in command.replace(" --", "\n--").replace(" -o ", "\n-o ").split("\n"):
        if line and len(line) + len(part) + 3 > width:
            lines.append(line + " \\")
            line = "  " + part
        else:
            line = f"{line} {part}" if line else part
    return "\n".join([*lines, line])


def row(data: Data) -> str:
    """One set of data in the table."""
    return f"| {data.title} | {data.where} | {data.terms} |"
