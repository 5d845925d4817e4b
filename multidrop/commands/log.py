r"""`multidrop log show|follow|grep|at|bisect|judge|replay`: session logs as text, searched, compared, taken again.

2026-11-22 12:41:06.020 >  press:b PR P
2026-11-22 12:41:06.020 >> press:b bPR P\n
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace as replaced
from pathlib import Path
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.text import counted, visible
from multidrop.shell import configuration
from multidrop.shell.line_syntax import join_target
from multidrop.shell.log import files, steps
from multidrop.shell.log.files import KINDS, TRAFFIC, Entry, Line
from multidrop.shell.log.judge import RULES, judged
from multidrop.shell.raw import text_of
from multidrop.shell.streams.stdout import lose, write

if TYPE_CHECKING:
    from datetime import datetime

    from multidrop.shell.log.moments import Known, Moments
    from multidrop.shell.session import Session

NOTHING_FOUND = 1
BROKEN = 1
DIFFERENT = 1
STAMP = 23
"""The length of a time in a shown entry."""
PERIOD = 0.1
"""The time between two looks at a log that is followed, s."""
LONGEST = 200
"""The bytes in one line, where no end of line came."""
MOST_BACKS = 3
"""The times when the clock was set back that are named."""
LAST = 10
"""The entries before the end with which following begins."""


def show(chosen: argparse.Namespace) -> int:
    return _reported(lambda: _print(files.whole(_path(chosen)), chosen, _wanted(chosen)))


def grep(chosen: argparse.Namespace) -> int:
    """Print the entries that match; the exit code says whether any does."""
    try:
        pattern = re.compile(chosen.pattern, re.IGNORECASE if chosen.ignore_case else 0)
    except re.error as problem:
        raise Diagnostic(f"{chosen.pattern!r} is not a regular expression: {problem}", "log grep") from None
    wanted = _wanted(chosen)
    found = 0

    def matching(entry: Entry) -> bool:
        nonlocal found
        matches = wanted(entry) and pattern.search(text(entry)) is not None
        found += matches
        return matches

    code = _reported(lambda: _print(files.whole(_path(chosen)), chosen, matching))
    return code or (0 if found else NOTHING_FOUND)


def follow(chosen: argparse.Namespace) -> int:
    """Print the last lines of a log, and then what is added, until interrupted."""
    wanted = _wanted(chosen)

    def put(lines: Iterable[Line]) -> None:
        for line in lines if chosen.json else joined(lines):
            _put(line, chosen, wanted)

    def work() -> None:
        following = Following(_path(chosen))
        put(list(following.look())[-LAST:])
        while True:
            time.sleep(PERIOD)
            put(following.look())

    try:
        return _reported(work)
    except KeyboardInterrupt:
        return 0


def judge(chosen: argparse.Namespace) -> int:
    """Print each breach of a rule; the exit code says whether there is any. Raises Diagnostic for a wrong file."""
    path = Path(chosen.file)
    found = judged(files.whole(path))
    if found.sessions == found.unmarked:
        why = "marks no commands and stops, as older versions did" if found.unmarked else "is not a session log"
        raise Diagnostic(why, str(path), "a log of this version is one JSON object a line")

    def work() -> None:
        for rule, line, entry, said in found.breaches:
            if chosen.json:
                fields = {"rule": rule, "time": entry.time.isoformat(), "where": line.where, "text": said}
                write(sys.stdout, json.dumps(fields))
            else:
                write(sys.stdout, f"{line.where}: {text(entry)[:STAMP]} {rule}: {said}")

    code = _reported(work)
    if found.unreadable:
        write(sys.stderr, files.left_out(found.unreadable, "judged"))
    counts = [counted(found.commands, "command"), counted(found.stops, "stop")]
    counts += [counted(found.gaps, "gap")] * bool(found.gaps) + ["older sessions left out"] * bool(found.unmarked)
    held = "no breach in the rest" if found.unreadable or found.gaps else f"all {len(RULES)} rules held"
    broken = counted(len(found.breaches), "breach", "breaches") if found.breaches else held
    write(sys.stderr, f"{path}: {broken} ({', '.join(counts)})")
    return code or (BROKEN if found.breaches or found.unreadable else 0)


def at(chosen: argparse.Namespace) -> int:
    """Print what was known at a time: the last entry of each kind and place, and the last polls."""
    from multidrop.shell.log import moments

    found = moments.known(_path(chosen), chosen.time)

    def work() -> None:
        if found.backs and not chosen.json:
            write(sys.stdout, _set_back(found))
        for each in found.known:
            write(sys.stdout, *(_objects(each, found) if chosen.json else _lines(each)))

    return _reported(work)


def _set_back(found: Moments) -> str:
    """The times when the clock of a log was set back, and what of the log is shown therefore, in one line."""
    backs = [f"{_time(before)} to {_time(after)}" for before, after in found.backs[-MOST_BACKS:]]
    more = len(found.backs) - len(backs)
    times = ", ".join(([f"{more} more"] if more else []) + backs)
    if found.total == 1:
        return f"the clock was set back in this log, from {times}; it has this time once"
    shown = "all" if found.total == len(found.known) else f"the last {len(found.known)}"
    return f"the clock was set back in this log, from {times}; it has this time {found.total} times: {shown} are shown"


def _objects(found: Known, all_: Moments) -> Iterator[str]:
    """A moment as JSON: its facts, the entries, and a sample for each axis."""
    session, stopped = found.session, found.stopped
    fact: dict[str, object] = {"at": found.at.isoformat(), "file": str(found.path)}
    fact |= {"session": "" if session is None else session.text}
    fact |= {"since": None if session is None else session.time.isoformat()}
    fact |= {"stopped": None if stopped is None else stopped.time.isoformat()}
    if all_.backs:
        backs = [[each.isoformat() for each in both] for both in all_.backs]
        fact |= {"clock_set_back": backs, "moments": all_.total}
    yield json.dumps({"moment": fact})
    yield from (line.data.decode().rstrip("\n") for line in found.lines)
    for (bus, drive), motions in found.motions.items():
        for each in motions:
            sample = {"time": each.at.isoformat(), "bus": bus, "drive": drive, "axis": each.axis}
            yield json.dumps({"sample": sample | {"position": each.position, "velocity": each.velocity}})


def _lines(found: Known) -> Iterator[str]:
    """A moment for a person."""
    begun = "" if found.session is None else f": {found.session.text} since {_stamp(found.session)}"
    yield f"{found.path} at {_time(found.at)}{begun}"
    if found.last is not None:
        yield f"the log ends at {_stamp(found.last)}"
    if found.stopped is not None:
        yield f"stopped since {_stamp(found.stopped)}"
    yield from (text(line.entry) for line in found.lines if line.entry is not None)
    for place, motions in found.motions.items():
        for each in motions:
            velocity = "" if each.velocity is None else f", velocity {each.velocity}"
            axis = each.axis and f" {each.axis}"
            yield f"{_time(each.at)} =  {visible(join_target(*place))}{axis} position {each.position}{velocity}"


def _time(moment: datetime) -> str:
    return moment.isoformat(" ", "milliseconds")[:STAMP]


def bisect(chosen: argparse.Namespace) -> int:
    """Print the first difference between two runs; the exit code says whether there is any, or may be."""
    from multidrop.shell.log import moments

    runs = [moments.Run(Path(file)) for file in (chosen.file1, chosen.file2)]
    found = moments.first_difference(*runs)
    lines = [None if index is None else run.line(index) for run, index in zip(runs, found or (None, None), strict=True)]
    damaged = [place for file in (chosen.file1, chosen.file2) for place in files.damaged(Path(file))]
    if damaged:
        write(sys.stderr, files.left_out(damaged, "compared"))

    def work() -> None:
        if chosen.json:
            both = [None if line is None else {"where": line.where, **json.loads(line.data)} for line in lines]
            fact = {"differ": found is not None, "lines": [len(run.steps) for run in runs], "first": both}
            fact |= {"unreadable": damaged} if damaged else {}
            write(sys.stdout, json.dumps(fact))
        elif found is None:
            readable = " that can be read" if damaged else ""
            write(sys.stdout, f"no difference in {counted(len(runs[0].steps), 'line')}{readable}")
        else:
            for file, run, line in zip((chosen.file1, chosen.file2), runs, lines, strict=True):
                none = f"{file}: nothing: its run has {counted(len(run.steps), 'line')}"
                entry = None if line is None else line.entry
                write(sys.stdout, none if line is None or entry is None else f"{line.where}: {text(entry)}")

    return _reported(work) or (DIFFERENT if found or damaged else 0)


def _stamp(entry: Entry) -> str:
    return text(entry)[:STAMP]


def replay(chosen: argparse.Namespace) -> int:
    """Take a log again on other drives; report a wrong file before anything is opened."""
    found = steps.read(Path(chosen.file))
    if not found.steps:
        raise Diagnostic("no line of the log was sent to a drive", chosen.file, "/log before the lines keeps them")
    if found.damaged:  # a stop may be missing
        write(sys.stderr, files.left_out(found.damaged, "sent"))
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
    return Path(chosen.file) if chosen.file else files.newest(configuration.load())


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
    for line in lines if chosen.json else joined(lines):
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
        shown = line.data.decode().rstrip("\n") if chosen.json else text(line.entry)
        sys.stdout.write(shown.encode(encoding := sys.stdout.encoding, "backslashreplace").decode(encoding) + "\n")
        sys.stdout.flush()


def text(entry: Entry) -> str:
    """An entry in one line, its control characters written out."""
    stamp = f"{entry.time:%Y-%m-%d %H:%M:%S}.{entry.time.microsecond // 1000:03}"
    where, typed = join_target(entry.bus, entry.drive), entry.text
    if entry.kind in TRAFFIC:
        return f"{stamp} {KINDS[entry.kind]:<2} {where} {text_of(typed.encode('latin-1'))}"
    if entry.kind == "typed" and entry.bus and typed.startswith("@"):  # the address precedes it already
        typed = typed.partition(" ")[2].strip()
    where = "" if entry.kind in ("notice", "failed") or not where else f"{visible(where)} "
    return f"{stamp} {KINDS[entry.kind]:<2} {where}{visible(typed, tabs=True)}"


def joined(lines: Iterable[Line]) -> Iterator[Line]:
    """Join the pieces of a reply that came one after the other, up to its end of line; the time is the first one's."""
    held: Line | None = None
    for line in lines:
        entry = line.entry
        if held is not None and not _continues(held.entry, entry):
            yield held
            held = None
        if entry is None or entry.kind != "received":
            yield line
        elif held is None or held.entry is None:
            held = line
        else:
            held = held._replace(entry=replaced(held.entry, text=held.entry.text + entry.text))
    if held is not None:
        yield held


def _continues(held: Entry | None, entry: Entry | None) -> bool:
    if held is None or entry is None or entry.kind != "received" or held.text.endswith("\n"):
        return False
    return (held.bus, held.drive, held.poll) == (entry.bus, entry.drive, entry.poll) and len(held.text) < LONGEST


class Following:
    """The lines that are added to a log, across its rotation. Nothing is held open between two looks."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = b""
        """The first line of the part that is read: it has a time, and a part is renamed."""
        self._offset = self._number = 0
        self.lost = False
        """Parts were removed before they were read."""

    def look(self) -> Iterator[Line]:
        """Yield the whole lines since the last look. Raises Diagnostic where the log cannot be read."""
        try:
            parts = files.parts(self._path)
            firsts = [_first(each) for each in parts]
            if self._file in firsts:
                parts = parts[firsts.index(self._file) :]
            else:
                self.lost = self._file != b""
            for path in parts:
                if (first := _first(path)) != self._file:
                    self._file, self._offset, self._number = first, 0, 0
                for line in files.lines(path, self._offset, self._number):
                    if line.data.endswith(b"\n"):
                        self._offset += len(line.data)
                        self._number = line.number
                        yield line
        except Diagnostic:
            if os.path.exists(self._path) or not os.path.exists(files.part(self._path, 1)):
                raise  # else it is being rotated: the next look finds its parts


def _first(path: Path) -> bytes:
    """The first line of a file, once it is whole."""
    first = next(files.lines(path), None)
    return first.data if first is not None and first.data.endswith(b"\n") else b""
