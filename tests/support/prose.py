"""Find the words to avoid in what people read: `make prose`. Python literals, comments, pages and tables are searched.

`tests/house/prose/avoided.csv` lists each pattern and what to use instead. Its words may be separated by line breaks.
`kept.csv` has the number of places that each file had before there was a list. That number may only fall:
`make prose KEEP=1` lowers it, and lets text move to another file, but never adds a place.
"""

from __future__ import annotations

import ast
import csv
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from tests.support.paths import ROOMS, ROOT, sources

AVOIDED = ROOT / "tests" / "house" / "prose" / "avoided.csv"
KEPT = AVOIDED.with_name("kept.csv")
GENERATED = ROOT / "multidrop" / "shipped"
"""What is made of other texts, which are searched themselves."""


class Avoided(NamedTuple):
    """A pattern, and the words to use instead of what it finds."""

    pattern: str
    instead: str

    @property
    def compiled(self) -> re.Pattern[str]:
        """The pattern for whole words in any case; a space is any white space, also with a `#` of a comment."""
        spaced = self.pattern.replace(" ", r"[\s#>]+")
        return re.compile(rf"\b(?:{spaced})(?![\w-])", re.IGNORECASE | re.MULTILINE)


class Place(NamedTuple):
    """A place of an avoided word."""

    file: str
    line: int
    text: str
    pattern: str
    instead: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {' '.join(self.text.split())!r}: use {self.instead}"


Counts = Counter[tuple[str, str]]
"""The number of places by file and pattern."""


def avoided() -> list[Avoided]:
    """Return the list of words to avoid."""
    return [Avoided(row["pattern"], row["instead"]) for row in _rows(AVOIDED)]


def kept() -> Counts:
    """Return the number of places that are accepted for each file and pattern."""
    return Counter({(row["file"], row["pattern"]): int(row["places"]) for row in _rows(KEPT)})


def _rows(path: Path) -> Iterator[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        yield from csv.DictReader(file)


def files() -> Iterator[tuple[str, Path]]:
    """Yield every file with text for people, by its name below the root."""
    yield from sources(*ROOMS)
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").rglob("*.md")):
        yield path.relative_to(ROOT).as_posix(), path
    for room in ROOMS[1:]:
        for path in (*(ROOT / room).rglob("*.csv"), *(ROOT / room).rglob("*.md")):
            yield path.relative_to(ROOT).as_posix(), path


def passages(name: str, text: str) -> Iterator[tuple[int, str]]:
    """Yield the texts for people in a file, with their first lines: of Python its literals and comments."""
    if not name.endswith(".py"):
        yield 1, text
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value
    comments: list[tuple[int, str]] = []
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            line = token.start[0]
            if comments and comments[-1][0] + comments[-1][1].count("\n") + 1 == line:
                comments[-1] = (comments[-1][0], f"{comments[-1][1]}\n{token.string}")
            else:
                comments.append((line, token.string))
    yield from comments


def places(name: str, text: str, words: Sequence[Avoided]) -> list[Place]:
    """Return each place of an avoided word in a file, in the order of its lines."""
    found = [
        Place(name, line + passage.count("\n", 0, match.start()), match[0], word.pattern, word.instead)
        for line, passage in passages(name, text)
        for word in words
        for match in word.compiled.finditer(passage)
    ]
    return sorted(found)


def all_places() -> list[Place]:
    """Return each place of an avoided word in the repository."""
    words = avoided()
    return [place for name, path in sorted(files()) for place in places(name, path.read_text("utf-8"), words)]


def counted(found: Sequence[Place]) -> Counts:
    """Count places by file and pattern."""
    return Counter((place.file, place.pattern) for place in found)


def grown(found: Sequence[Place], accepted: Mapping[tuple[str, str], int]) -> list[Place]:
    """Return all places of each file and pattern that has more than accepted: which of them is new is unknown."""
    counts = counted(found)
    return [
        place for place in found if counts[place.file, place.pattern] > accepted.get((place.file, place.pattern), 0)
    ]


def added(counts: Counts, accepted: Counts) -> list[str]:
    """Return the patterns with more places in all files together than accepted."""
    now, before = Counter[str](), Counter[str]()
    for totals, each in ((now, counts), (before, accepted)):
        for (_, pattern), number in each.items():
            totals[pattern] += number
    return sorted(pattern for pattern in now if now[pattern] > before[pattern])


def keep(counts: Counts) -> None:
    """Write the accepted number of places."""
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("file", "pattern", "places"))
        writer.writerows((*key, number) for key, number in sorted(counts.items()))


def main(arguments: Sequence[str]) -> int:
    """Print the places that may be new, or all; keep the numbers as they are now. Return 1 if there are new ones."""
    found, accepted = all_places(), kept()
    if "--all" in arguments:
        for place in found:
            print(place)
    counts = counted(found)
    if "--keep" in arguments:
        if more := added(counts, accepted):
            print(f"not kept: more places than before of {', '.join(more)}")
        else:
            keep(counts)
            accepted = counts
    new = grown(found, accepted)
    for place in new:
        print(place)
    print(f"{len(found)} places of words to avoid, {accepted.total()} accepted", end="")
    print("; some of the places above are new" if new else "; none is new")
    if not new and counts != accepted:
        print("make prose KEEP=1 lowers the accepted number")
    return 1 if new else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
