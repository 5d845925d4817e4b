"""Which tests execute a line: measured by `make map`, kept in `tests.json.xz`, and read here.

A function of the product is divided into blocks: lines that the same tests execute. A line is counted from the first
line of its function, so that a change elsewhere in the file moves nothing. A line that is new has the tests of all
blocks of its function, or of its file.
"""

from __future__ import annotations

import json
import lzma
import re
import sqlite3
from collections import Counter, defaultdict
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from soak.drawn.operators import functions
from soak.drawn.rooms import ROOMS, ROOT, files

FILE = Path(__file__).with_name("tests.json.xz")
FASTEST, CLOSEST = 12, 24
"""How many tests are kept of a block: the fastest ones, those that execute least else, and the fastest of each file."""
UNTIMED = 0.01
"""s; a test for which pytest printed no duration."""


class MeasuredTest(NamedTuple):
    """A test function. `node`: without its cases; `seconds`: of all its cases; `quick`: `make quick` runs it."""

    node: str
    seconds: float
    quick: bool


@dataclass(frozen=True)
class Map:
    """The tests, and for each file and function the blocks: offsets of lines, and numbers of tests."""

    tests: list[MeasuredTest]
    blocks: dict[str, dict[str, list[tuple[list[int], list[int]]]]]

    def of(self, path: str, line: int, source: bytes) -> list[MeasuredTest]:
        """The tests that execute a line of a file: those of `make quick` first, of these the module's own.

        So there is time for the module's own tests of a line that hundreds of others execute, too.
        """
        inner = [each for each in functions(source) if each[1] <= line <= each[2]]
        name, first = (inner[-1][0], inner[-1][1]) if inner else ("", 1)
        blocks = self.blocks.get(path, {}).get(name, [])
        found = [tests for lines, tests in blocks if line - first in lines] or [tests for _, tests in blocks]
        if not found:
            found = [tests for blocks in self.blocks.get(path, {}).values() for _, tests in blocks]
        numbers = {number for tests in found for number in tests}
        own = f"/test_{Path(path).stem}.py::"
        return sorted(
            (self.tests[number] for number in numbers),
            key=lambda each: (not each.quick, own not in each.node, each.seconds),
        )


def kept() -> Map:
    """The map that was measured last. Raises FileNotFoundError."""
    with lzma.open(FILE, "rt", encoding="utf-8") as file:
        data = json.load(file)
    return Map([MeasuredTest(*each) for each in data["tests"]], data["blocks"])


def function(node: str) -> str:
    """The test function of a node, or of a context of coverage."""
    return re.split(r"[\[|]", node, maxsplit=1)[0]


def seconds(durations: str) -> dict[str, float]:
    """The time of each test function, from what pytest prints with `--durations=0`."""
    times = defaultdict[str, float](float)
    for line in durations.splitlines():
        if found := re.match(r"([\d.]+)s (?:call|setup|teardown)\s+(\S.*)$", line):
            times[function(found[2])] += float(found[1])
    return times


def measured(data: Path, durations: str, quick: Iterable[str]) -> Map:
    """Make a map of a coverage file with a context for each test. `quick`: nodes of the tests of `make quick`."""
    times, fast = seconds(durations), {function(each) for each in quick}
    executed: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
    with closing(sqlite3.connect(data)) as database:
        names = {number: function(name) for number, name in database.execute("select id, context from context")}
        paths = {number: _path(name) for number, name in database.execute("select id, path from file")}
        for file, context, begin, end in database.execute("select file_id, context_id, fromno, tono from arc"):
            if names[context] and (path := paths[file]):
                for line in (begin, end):
                    if line > 0:
                        executed[path][line].add(names[context])
    return _compact(executed, times, fast)


def _path(measured: str) -> str:
    """The path of a measured file from the root of the tree; a room's link leads to the room. Empty: in no room."""
    path = Path(measured).resolve()
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else ""


def _compact(executed: dict[str, dict[int, set[str]]], times: dict[str, float], fast: set[str]) -> Map:
    weights = Counter(test for lines in executed.values() for tests in lines.values() for test in tests)
    names = sorted(weights)
    number = {name: at for at, name in enumerate(names)}
    tests = [MeasuredTest(name, round(max(times[name], UNTIMED), 2), name in fast) for name in names]
    blocks: dict[str, dict[str, list[tuple[list[int], list[int]]]]] = {}
    for path in sorted({each for room in ROOMS for each in files(room)} & set(executed)):
        found: dict[str, dict[int, set[int]]] = defaultdict(dict)
        places = list(functions((ROOT / path).read_bytes()))
        for line, tests_of_line in sorted(executed[path].items()):
            inner = [each for each in places if each[1] <= line <= each[2]]
            if inner:
                name, first, _ = inner[-1]
                found[name][line - first] = {number[each] for each in _chosen(tests_of_line, times, weights)}
        blocks[path] = _grouped(found)
    return Map(tests, blocks)


def joined(old: Map, new: Map) -> Map:
    """Return the map with what was measured anew: the tests of these files replace all that was known of the files."""
    again = {each.node.partition("::")[0] for each in new.tests}
    tests = {each.node: each for each in old.tests if each.node.partition("::")[0] not in again}
    tests |= {each.node: each for each in new.tests}
    names = sorted(tests)
    number = {name: at for at, name in enumerate(names)}
    lines: dict[str, dict[str, dict[int, set[int]]]] = {}
    for made in (old, new):
        for path, functions_of_path in made.blocks.items():
            for name, blocks in functions_of_path.items():
                here = lines.setdefault(path, {}).setdefault(name, {})
                for offsets, numbers in blocks:
                    kept_here = {number[node] for at in numbers if (node := made.tests[at].node) in number}
                    for offset in offsets:
                        here.setdefault(offset, set()).update(kept_here)
    return Map([tests[name] for name in names], {path: _grouped(each) for path, each in lines.items()})


def _grouped(lines: dict[str, dict[int, set[int]]]) -> dict[str, list[tuple[list[int], list[int]]]]:
    """The blocks of the functions of a file, from the tests of each line."""
    found: dict[str, list[tuple[list[int], list[int]]]] = {}
    for name, tests_of_lines in lines.items():
        blocks: dict[tuple[int, ...], list[int]] = defaultdict(list)
        for offset, tests in sorted(tests_of_lines.items()):
            blocks[tuple(sorted(tests))].append(offset)
        found[name] = [(offsets, list(tests)) for tests, offsets in blocks.items()]
    return found


def _chosen(tests: set[str], times: dict[str, float], weights: Counter[str]) -> set[str]:
    """Some of the tests of a line: the fastest, those that execute least else (they are about it), one of each file.

    A line that every session runs is seen by the tests of one promise, in a file that the other two do not reach.
    """
    fastest = sorted(tests, key=lambda each: (times[each], each))
    closest = sorted(tests, key=lambda each: (weights[each], each))[:CLOSEST]
    of_files = dict[str, str]()
    for each in fastest:
        of_files.setdefault(each.partition("::")[0], each)
    return {*fastest[:FASTEST], *closest, *of_files.values()}


def keep(made: Map) -> None:
    """Write a map to its file."""
    with lzma.open(FILE, "wt", encoding="utf-8") as file:
        json.dump({"tests": made.tests, "blocks": made.blocks}, file, separators=(",", ":"))
