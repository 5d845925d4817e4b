"""A configuration with errors: all of them at once, what is right all the same, and what is not in force.

A key with an error is left out, and the rest is read again, until nothing is wrong. Of a file that is no TOML each
section is read by itself.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines, toml_keys, toml_names, toml_of, utf8_of
from multidrop.shell.sections import valid

WAY = "--no-config goes on without the file"
_HEADER = re.compile(r"\s*\[\[?([^\]]*)\]")

Path = tuple[str, ...]
Problems = tuple[Diagnostic, ...]
T = TypeVar("T")


class WrongConfiguration(Diagnostic):
    """A configuration with errors. It reads as the first of them; the last one says how to go on without the file."""

    def __init__(self, problems: Problems) -> None:
        *before, last = problems
        last = Diagnostic(last.message, last.where, f"{last.hint}; {WAY}" if last.hint else WAY)
        self.problems = (*before, last)
        super().__init__(self.problems[0].message, self.problems[0].where, self.problems[0].hint)


def salvage(text: str, where: str, read: Callable[[dict[str, Any], str], T]) -> tuple[T, Problems, dict[str, str]]:
    """Read what is right, by `read`, which raises Diagnostic with the key at the beginning of its message.

    Also returns each error, and the errors of saved connections that lack names, units or guards by their names; an
    empty name: every line. Raises what `read` raises of an empty document.
    """
    document, problems, lost = _sections(text, where)
    while True:
        try:
            told = sorted(problems, key=lambda each: int(each.where.rpartition(":")[2]) if each.where != where else 0)
            return read(document, where), tuple(told), dict(reversed([*_doubts(lost)]))
        except Diagnostic as problem:
            if not document:  # nothing is left that could be left out
                raise
            # The longest path of the document with which a message begins; that of the file itself is empty.
            name = problem.message.removeprefix("no key ")
            paths = [path for path in _paths(document) if re.match(rf"{re.escape('.'.join(path))}(?![\w-])", name)]
            path = max(paths, key=len, default=())
            at = line_of(text, path)  # a name in quotation marks is not what its message begins with
            placed_at = f"{where}:{at}" if at and path else placed(problem.message, text, where).where
            problems.append(Diagnostic(problem.message, placed_at, problem.hint))
            lost.append((path, problems[-1]))
            _leave_out(document, path[:2] if path[2:] == ("url",) else path)


def _sections(text: str, where: str) -> tuple[dict[str, Any], list[Diagnostic], list[tuple[Path, Diagnostic]]]:
    """The document, and the errors of its sections, each with the name of the section."""
    try:
        return toml_of(text, where), [], []
    except Diagnostic as problem:
        whole = problem
    lines = split_lines(text)
    starts = [0, *(number for number, line in enumerate(lines) if _HEADER.match(line))]
    document: dict[str, Any] = {}
    lost: list[tuple[Path, Diagnostic]] = []
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        try:
            _join(document, toml_of("\n" * start + "\n".join(lines[start:end]), where))
        except Diagnostic as problem:
            header = _HEADER.match(lines[start]) if lines else None
            at = f"{where}:{start + 1}" if problem.where == where else problem.where
            lost.append((tuple(toml_names(header[1])) if header else (), Diagnostic(problem.message, at, problem.hint)))
    lost = lost or [((), whole)]  # a section that is there twice
    return document, [problem for _, problem in lost], lost


def _join(document: dict[str, Any], more: Mapping[str, Any]) -> None:
    for key, value in more.items():
        if isinstance(value, dict) and isinstance(document.get(key), dict):
            _join(document[key], value)
        else:
            document.setdefault(key, value)


def _paths(document: Mapping[str, Any], above: Path = ()) -> Iterator[Path]:
    for key, value in document.items():
        yield (*above, key)
        if isinstance(value, dict):
            yield from _paths(value, (*above, key))


def _leave_out(document: dict[str, Any], path: Path) -> None:
    if not path:
        return document.clear()
    for key in path[:-1]:
        document = document[key]
    del document[path[-1]]


def _doubts(lost: list[tuple[Path, Diagnostic]]) -> Iterator[tuple[str, str]]:
    """The saved connections whose drives lack something, each with the error; an empty name is every line."""
    for path, problem in lost:
        table, *inner = path or ("guards",)
        if table == "connections" and inner:
            yield inner[0], str(problem)
        elif (table in ("guards", "connections") and inner != ["off"]) or table not in valid():
            yield "", str(problem)  # an unknown table may be that of the guards, spelled wrong


def placed(message: str, text: str, where: str, hint: str = "") -> Diagnostic:
    """A Diagnostic with the line of the key that the message begins with: `no key screen.x`, `log.files is not ...`."""
    key = re.match(r"(?:no key )?([\w.-]+)", message)
    line = line_of(text, key[1].rstrip(".").split(".")) if key else 0
    return Diagnostic(message, f"{where}:{line}" if line else where, hint)


def placed_in_file(message: str, where: str) -> Diagnostic:
    """The same with the text of that file, if it can be read."""
    try:
        return placed(message, utf8_of(where), where)
    except Diagnostic:
        return Diagnostic(message, where)


def line_of(text: str, key: Sequence[str]) -> int:
    """The number of the line with a key, given with its tables (`screen`, `theme`), or the nearest table's; 0: none."""
    best = depth = 0
    for way, number, _ in toml_keys(text):
        names = [name for name, _ in way]
        if names == list(key):
            return number
        if len(names) > depth and names == list(key[: len(names)]):
            best, depth = number, len(names)
    return best
