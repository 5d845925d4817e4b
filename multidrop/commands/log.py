"""`multidrop log show|follow|grep|replay`: session logs for people and programs, and taken again."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic
from multidrop.shell.connect import settings
from multidrop.shell.log import files, steps
from multidrop.shell.log import show as showing
from multidrop.shell.log.entries import Entry
from multidrop.shell.log.files import Line
from multidrop.shell.streams.stdout import lose, write

if TYPE_CHECKING:
    from multidrop.shell.session import Session

NOTHING_FOUND = 1


def show(chosen: argparse.Namespace) -> int:
    return _reported(lambda: _print(showing.whole(_path(chosen)), chosen, _wanted(chosen)))


def grep(chosen: argparse.Namespace) -> int:
    """Print the entries that match; the exit code says whether any does."""
    try:
        pattern = re.compile(chosen.pattern, re.IGNORECASE if chosen.ignore_case else 0)
    except re.error as problem:
        raise Diagnostic(f"{chosen.pattern!r} is not a regular expression: {problem}", "log grep") from None
    wanted = _wanted(chosen)
    found = 0

    def counted(entry: Entry) -> bool:
        nonlocal found
        matches = wanted(entry) and showing.matches(entry, pattern)
        found += matches
        return matches

    code = _reported(lambda: _print(showing.whole(_path(chosen)), chosen, counted))
    return code or (0 if found else NOTHING_FOUND)


def follow(chosen: argparse.Namespace) -> int:
    wanted = _wanted(chosen)

    def put(lines: Iterable[Line]) -> None:
        for line in lines if chosen.json else showing.joined(lines):
            _put(line, chosen, wanted)

    try:
        return _reported(lambda: showing.follow(_path(chosen), put))
    except KeyboardInterrupt:
        return 0


def replay(chosen: argparse.Namespace) -> int:
    """Take a log again on other drives; report a wrong file before anything is opened."""
    found = steps.read(Path(chosen.file))
    if not found.steps:
        raise Diagnostic("no line of the log was sent to a drive", chosen.file, "/log before the lines keeps them")
    from multidrop.shell.batch import runner
    from multidrop.shell.batch.replay import ReplayReport, VirtualLoop
    from multidrop.shell.batch.replay import replay as run

    async def body(session: Session) -> None:
        await run(session, found, fast=chosen.fast, positions=bool(chosen.against), report=ReplayReport(chosen.json))

    url = chosen.to or f"sim:{chosen.against.removeprefix('sim:')}"
    loop = VirtualLoop if chosen.against else None
    return runner.run([url], body, agreed=chosen.yes, unsolicited=False, replies=False, loop=loop)


def _reported(work: Callable[[], None]) -> int:
    """Do the work; return the exit code. A reader that goes away (`| head`) ends it well."""
    try:
        work()
    except (OSError, ValueError) as problem:
        lose(sys.stdout, problem)
    return 0


def _path(chosen: argparse.Namespace) -> Path:
    """The log that is named, or the newest. Raises Diagnostic."""
    return Path(chosen.file) if chosen.file else files.newest(settings.load())


def _wanted(chosen: argparse.Namespace) -> Callable[[Entry], bool]:
    """The filter of entries: by drive, and without polls unless all are asked for."""
    named = set(filter(None, chosen.drive.split(",")))
    every = not named or "all" in named

    def wanted(entry: Entry) -> bool:
        own = every or entry.drive in named or f"{entry.bus}:{entry.drive}" in named
        return (chosen.all or not entry.poll) and own

    return wanted


def _print(lines: Iterable[Line], chosen: argparse.Namespace, wanted: Callable[[Entry], bool]) -> None:
    """Print the entries; report the lines that are none. Raises Diagnostic for a file without an entry."""
    known, wrong = 0, ""
    for line in lines if chosen.json else showing.joined(lines):
        known += line.entry is not None
        wrong = wrong or ("" if line.entry else line.where)
        if known:
            _put(line, chosen, wanted)
    if wrong and not known:
        raise Diagnostic("is not an entry of a session log", wrong, "a log of this version is one JSON object a line")


def _put(line: Line, chosen: argparse.Namespace, wanted: Callable[[Entry], bool]) -> None:
    if line.entry is None:
        if line.data.strip():
            write(sys.stderr, f"{line.where}: not a whole entry: {line.data[:80]!r}")
    elif wanted(line.entry):
        text = line.data.decode().rstrip("\n") if chosen.json else showing.text(line.entry)
        sys.stdout.write(text.encode(encoding := sys.stdout.encoding, "backslashreplace").decode(encoding) + "\n")
        sys.stdout.flush()
