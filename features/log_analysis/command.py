"""`multidrop log at|bisect|judge|replay`: session logs asked, compared, checked by rules, taken again."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.text import counted, visible
from multidrop.commands.log import STAMP, log_path, reported, text
from multidrop.features.log_analysis import moments
from multidrop.features.log_analysis.differences import Run, first_difference
from multidrop.features.log_analysis.judge import RULES, judged
from multidrop.features.log_analysis.moments import KnownMoment, Moments
from multidrop.features.log_analysis.replay import ReplayReport
from multidrop.features.log_analysis.replay import replay as run
from multidrop.shell.batch import runner
from multidrop.shell.batch.virtual_loop import VirtualLoop
from multidrop.shell.line_syntax import join_target
from multidrop.shell.log import files, steps
from multidrop.shell.log.files import LogEntry
from multidrop.shell.streams.stdout import write

if TYPE_CHECKING:
    from multidrop.shell.session import Session

BROKEN = 1
DIFFERENT = 1
MOST_BACKS = 3
"""The times when the clock was set back that are named."""


def judge(file: str, as_json: bool) -> int:
    """Print each breach of a rule; the exit code says whether there is any. Raises Diagnostic for a wrong file."""
    path = Path(file)
    judgement = judged(files.whole(path))
    if judgement.sessions == judgement.unmarked:
        why = "marks no commands and stops, as older versions did" if judgement.unmarked else "is not a session log"
        raise Diagnostic(why, str(path), "a log of this version is one JSON object a line")

    def work() -> None:
        for rule, line, entry, said in judgement.breaches:
            if as_json:
                fields = {"rule": rule, "time": entry.time.isoformat(), "where": line.where, "text": said}
                write(sys.stdout, json.dumps(fields))
            else:
                write(sys.stdout, f"{line.where}: {text(entry)[:STAMP]} {rule}: {said}")

    code = reported(work)
    if judgement.unreadable:
        write(sys.stderr, files.left_out(judgement.unreadable, "judged"))
    counts = [counted(judgement.commands, "command"), counted(judgement.stops, "stop")]
    counts += [counted(judgement.gaps, "gap")] * bool(judgement.gaps) + ["older sessions left out"] * bool(
        judgement.unmarked
    )
    held = "no breach in the rest" if judgement.unreadable or judgement.gaps else f"all {len(RULES)} rules held"
    broken = counted(len(judgement.breaches), "breach", "breaches") if judgement.breaches else held
    write(sys.stderr, f"{path}: {broken} ({', '.join(counts)})")
    return code or (BROKEN if judgement.breaches or judgement.unreadable else 0)


def at(time: str, file: str, as_json: bool) -> int:
    """Print what was known at a time: the last entry of each kind and place, and the last polls."""
    moment = moments.known(log_path(file), time)

    def work() -> None:
        if moment.backs and not as_json:
            write(sys.stdout, _set_back(moment))
        for known in moment.known:
            write(sys.stdout, *(_objects(known, moment) if as_json else _lines(known)))

    return reported(work)


def _set_back(found: Moments) -> str:
    """The times when the clock of a log was set back, and what of the log is shown therefore, in one line."""
    backs = [f"{_time(before)} to {_time(after)}" for before, after in found.backs[-MOST_BACKS:]]
    more = len(found.backs) - len(backs)
    times = ", ".join(([f"{more} more"] if more else []) + backs)
    if found.total == 1:
        return f"the clock was set back in this log, from {times}; it has this time once"
    shown = "all" if found.total == len(found.known) else f"the last {len(found.known)}"
    return f"the clock was set back in this log, from {times}; it has this time {found.total} times: {shown} are shown"


def _objects(found: KnownMoment, all_: Moments) -> Iterator[str]:
    """A moment as JSON: its facts, the entries, and a sample for each axis."""
    session, stopped = found.session, found.stopped
    fact: dict[str, object] = {"at": found.at.isoformat(), "file": str(found.path)}
    fact |= {"session": "" if session is None else session.text}
    fact |= {"since": None if session is None else session.time.isoformat()}
    fact |= {"stopped": None if stopped is None else stopped.time.isoformat()}
    if all_.backs:
        backs = [[moment.isoformat() for moment in both] for both in all_.backs]
        fact |= {"clock_set_back": backs, "moments": all_.total}
    yield json.dumps({"moment": fact})
    yield from (line.data.decode().rstrip("\n") for line in found.lines)
    for (bus, drive), motions in found.motions.items():
        for motion in motions:
            sample = {"time": motion.at.isoformat(), "bus": bus, "drive": drive, "axis": motion.axis}
            yield json.dumps({"sample": sample | {"position": motion.position, "velocity": motion.velocity}})


def _lines(found: KnownMoment) -> Iterator[str]:
    """A moment for a person."""
    begun = "" if found.session is None else f": {found.session.text} since {_stamp(found.session)}"
    yield f"{found.path} at {_time(found.at)}{begun}"
    if found.last is not None:
        yield f"the log ends at {_stamp(found.last)}"
    if found.stopped is not None:
        yield f"stopped since {_stamp(found.stopped)}"
    yield from (text(line.entry) for line in found.lines if line.entry is not None)
    for place, motions in found.motions.items():
        for motion in motions:
            velocity = "" if motion.velocity is None else f", velocity {motion.velocity}"
            axis = motion.axis and f" {motion.axis}"
            yield f"{_time(motion.at)} =  {visible(join_target(*place))}{axis} position {motion.position}{velocity}"


def _time(moment: datetime) -> str:
    return moment.isoformat(" ", "milliseconds")[:STAMP]


def bisect(file1: str, file2: str, as_json: bool) -> int:
    """Print the first difference between two runs; the exit code says whether there is any, or may be."""
    runs = [Run(Path(file)) for file in (file1, file2)]
    difference = first_difference(*runs)
    lines = [
        None if index is None else run.line(index) for run, index in zip(runs, difference or (None, None), strict=True)
    ]
    damaged = [place for file in (file1, file2) for place in files.damaged(Path(file))]
    if damaged:
        write(sys.stderr, files.left_out(damaged, "compared"))

    def work() -> None:
        if as_json:
            both = [None if line is None else {"where": line.where, **json.loads(line.data)} for line in lines]
            fact = {"differ": difference is not None, "lines": [len(run.steps) for run in runs], "first": both}
            fact |= {"unreadable": damaged} if damaged else {}
            write(sys.stdout, json.dumps(fact))
        elif difference is None:
            readable = " that can be read" if damaged else ""
            write(sys.stdout, f"no difference in {counted(len(runs[0].steps), 'line')}{readable}")
        else:
            for file, run, line in zip((file1, file2), runs, lines, strict=True):
                none = f"{file}: nothing: its run has {counted(len(run.steps), 'line')}"
                entry = None if line is None else line.entry
                write(sys.stdout, none if line is None or entry is None else f"{line.where}: {text(entry)}")

    return reported(work) or (DIFFERENT if difference or damaged else 0)


def _stamp(entry: LogEntry) -> str:
    return text(entry)[:STAMP]


def replay(file: str, to: str, against: str, fast: bool, as_json: bool, agreed: bool) -> int:
    """Take a log again on other drives; report a wrong file before anything is opened."""
    logged = steps.read(Path(file))
    if not logged.steps:
        raise Diagnostic("no line of the log was sent to a drive", file, "/log before the lines keeps them")
    if logged.damaged:  # a stop may be missing
        write(sys.stderr, files.left_out(logged.damaged, "sent"))

    async def body(session: Session) -> None:
        await run(session, logged, fast=fast, positions=bool(against), report=ReplayReport(as_json))

    url = to or f"sim:{against.removeprefix('sim:')}"
    loop = VirtualLoop if against else None
    return runner.run([url], body, agreed=agreed, unsolicited=False, replies=False, loop=loop)
