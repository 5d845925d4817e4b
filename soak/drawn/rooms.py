"""The rooms that mutants are drawn in, and the mutants that change nothing, marked by hand with the reason."""

from __future__ import annotations

import csv
import random
from collections.abc import Iterator
from pathlib import Path

from soak.drawn.operators import Mutant, mutants, valid

ROOT = Path(__file__).parents[2]
EQUIVALENT = Path(__file__).with_name("equivalent.csv")
"""path, function, before, after, why: mutants that behave as the program does."""
ROOMS = {
    "drives": ("drives/**/*.py",),
    "transports": ("transports/**/*.py",),
    "families": ("families/*/host/**/*.py",),
    "shell": ("shell/**/*.py",),
    "macros": ("macros/**/*.py",),
    "base": ("base/**/*.py",),
    "features": ("features/**/*.py",),
    "multidrop": ("multidrop/*.py", "multidrop/commands/**/*.py", "multidrop/api/**/*.py"),
}
"""The files of each room. `families`: the host's side of each language; a manual is facts, which tests compare."""


def files(room: str, root: Path = ROOT) -> list[str]:
    """The files of a room, from the root of the tree."""
    found = {each for pattern in ROOMS[room] for each in root.glob(pattern) if each.is_file()}
    return sorted(str(each.relative_to(root)) for each in found)


def equivalent() -> set[tuple[str, str, str, str]]:
    """The marked mutants: path, function, and the text before and after."""
    with EQUIVALENT.open(newline="", encoding="utf-8") as file:
        return {(row["path"], row["function"], row["before"], row["after"]) for row in csv.DictReader(file)}


def draw(room: str, count: int, seed: int, root: Path = ROOT) -> list[Mutant]:
    """Draw mutants of a room, one a line at most. The same seed draws the same ones from the same text."""
    marked = equivalent()
    every = [each for path in files(room, root) for each in mutants(path, (root / path).read_bytes())]
    random.Random(f"{seed} {room}").shuffle(every)
    return [each for each, _ in zip(_usable(every, marked, root), range(count), strict=False)]


def _usable(every: list[Mutant], marked: set[tuple[str, str, str, str]], root: Path) -> Iterator[Mutant]:
    lines = set[tuple[str, int]]()
    for each in every:
        place = each.path, each.line
        if place in lines or (each.path, each.function, each.before, each.after) in marked:
            continue
        if valid(each.planted((root / each.path).read_bytes())):
            lines.add(place)
            yield each
