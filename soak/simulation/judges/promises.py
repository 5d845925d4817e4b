"""Rules of what runs by itself, of questions, of program mode and of raw mode: what `Told` has, against the record."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from math import inf

from soak.simulation.judges.outcomes import ASTRAY, BARE_COMMAND, astray, became
from soak.simulation.judges.rule import Granted, Lived, Rule
from soak.simulation.records.history import NUMBER, Executed
from soak.simulation.records.told import NEAR, SHORT, Guarded, Put, Run

PLACE = re.compile(r"(?:backup: |before is in )(\S+)")
"""What names a backup."""
CLEARS = "CP"
"""What clears the programs of an MCode drive."""


def _workshop(life: Lived) -> Iterator[str]:
    """Only jobs of a workshop look for this: see `judge.judged`."""
    return iter(())


def _automation(life: Lived) -> Iterator[str]:
    yield from life.history.told.unstopped
    yield from life.history.told.stopped_too


def _spared(life: Lived) -> Iterator[str]:
    yield from life.history.told.unspared


STOPS = ("41 2020", "10 0078")
"""The messages of a stop over Modbus: the end of the program, and SL 0."""
REPEATED = 10.0
"""The time, s, in which a stop is repeated, or sent to a connection that was lost."""


def _stranger(life: Lived) -> Iterator[str]:
    """Each message is that of a typed line, as often as it was typed at most, or part of a stop."""
    for strange in life.history.told.strangers:
        left = Counter(strange.typed)
        for at, message in strange.heard:
            if message in STOPS and any(each <= at <= each + REPEATED for each in strange.stops):
                continue
            left[message] -= 1
            if left[message] < 0:
                yield f"{message!r} at {at:.3f}, typed {strange.typed.count(message)} times"


def _outcome(life: Lived) -> Iterator[str | Granted]:
    """The line after a wait is executed at the target only, and what is at its target was not said to have failed."""
    for each in life.history.told.awaited:
        line, drive, text = each.after
        done = any((one.line, one.drive, one.text) == each.after for one in life.history.executed)
        there = abs(each.position - each.goal) <= NEAR
        words = f"{line}:{drive} at {each.position} of {each.goal}: {text!r} was {'' if done else 'not '}executed"
        words += f" ({each.run.failure or 'done'})"
        wrong = (done and not there) or (not done and there and SHORT.search(each.run.failure))
        cut = any(each.run.began <= at <= each.run.ended for at in life.cut.get((line, drive), ()))
        if wrong and not cut:
            noisy = became(life, line, each.run.ended, each.run.began)
            yield Granted(BARE_COMMAND, words) if noisy else words


def _asked(life: Lived) -> Iterator[str | Granted]:
    told = life.history.told
    for guarded in told.guarded:
        for each in life.history.executed:
            if (each.line, each.drive, each.text) not in guarded.texts or each.at < guarded.typed:
                continue
            if guarded.asks and _agreed(life, guarded, each):
                continue
            if each.text == CLEARS and any(_downloads(life, run, each) for run in told.runs.values()):
                continue  # what is in the place of the file's program, as the download says
            words = f"{each.line}:{each.drive} {each.text!r}, typed at {guarded.typed:.3f}, executed without a yes"
            yield Granted(BARE_COMMAND, words) if became(life, each.line, each.at) else words


def _agreed(life: Lived, guarded: Guarded, each: Executed) -> bool:
    """Whether a yes belongs to a line that was executed, or to the same line that was typed before it."""
    told, key = life.history.told, (each.line, each.drive, each.text)
    for other in told.guarded:
        if other is guarded or (other.asks and key in other.texts and other.typed < guarded.typed):
            first = not any(
                (one.line, one.drive, one.text) == key and other.typed <= one.at < each.at
                for one in life.history.executed
            )
            if (other is guarded or first) and any(other.typed <= yes <= each.at for yes in told.yes):
                return True
    return False


def _downloads(life: Lived, run: Run, each: Executed) -> bool:
    """Whether a program was downloaded to a drive as it executed a line; a kill ends a download without a word."""
    done = run.download
    if done is None or (done.line, done.drive) != (each.line, each.drive) or not 0 <= run.began <= each.at:
        return False
    ended = (
        run.ended if run.ended >= run.began else min((at for at in life.history.deaths if at >= run.began), default=inf)
    )
    return each.at <= ended


def _stored(life: Lived) -> Iterator[str | Granted]:
    for put in life.history.told.stored:
        for each in life.history.executed:
            if (each.line, each.drive, each.text) == (put.line, put.drive, put.text) and each.at >= put.at:
                words = f"{put.line}:{put.drive} {put.text!r} of program mode, executed at {each.at:.3f}"
                yield Granted(BARE_COMMAND, words) if became(life, each.line, each.at) else words


def _programs(life: Lived) -> Iterator[str | Granted]:
    """A download of which no trace is left in the drive breaks nothing, and so does one that a power-up took away.

    Where it has named a backup, that has the old program, whatever came of the download.
    """
    told = life.history.told
    for run in told.runs.values():
        done = run.download
        if done is None or run.began < 0 or done.new == done.old:
            continue
        if done.restarted:  # over Ethernet it loses the old program only as it has booted
            continue
        coded = life.place(done.line).language == "pmx"
        old = [part for line in done.old for part in (re.findall(NUMBER, line) if coded else [line.partition(" ")[2]])]
        named = {each for at, text in life.history.notices if at >= run.began for each in PLACE.findall(text)}
        whole = any(all(each.strip() in told.backups.get(path, "") for each in old) for path in named)
        if not run.failure:
            new = any(re.findall(NUMBER, done.text)[-1] in line for line in done.new)
            whole = new and (whole or not named & told.backups.keys())
        if not whole:
            when = f"{run.began:.3f} to {run.ended:.3f}"
            words = f"{run.typed!r} from {when} ({run.failure or 'done'}): {done.old}, {done.new}"
            late = astray(life, done.line, run.began, run.ended)
            grant = BARE_COMMAND if became(life, done.line, run.ended, run.began) else ASTRAY if late else None
            yield Granted(grant, words) if grant else words


def _raw(life: Lived) -> Iterator[str]:
    """Each text leaves as often as it was typed, whole or, where the line was lost, not; and nothing else leaves."""
    told = life.history.told
    for line, data in told.raw_written.items():
        written = bytes(data)
        puts: list[Put] = [put for put in told.raw if put.line == line]
        for put in puts:
            typed = sum(each.text == put.text for each in puts)
            left = len(re.findall(rb"(?<![ -~])" + re.escape(put.text.encode()) + rb"(?![ -~])", written))
            if left > typed:
                yield f"{line}: {put.text!r} left {left} times, and was typed {typed} times"


def _latched(life: Lived) -> Iterator[str]:
    """Lines of a macro or a script that began after a stop and before `/resume` are executed before that."""
    told = life.history.told
    for run in told.runs.values():
        if not run.automatic or not any(on for _, on in told.latches[: run.latches][-1:]):
            continue
        until = next((at for at, on in told.latches[run.latches :] if not on), float("inf"))
        for each in life.history.executed:
            if (each.line, each.drive, each.text) in run.texts and run.began <= each.at < until:
                yield f"{each.line}:{each.drive} {each.text!r} of {run.typed!r}, begun after a stop, at {each.at:.3f}"


PROMISES = (
    Rule(
        "latched",
        "No macro and no script that begins between a stop and `/resume` sends anything.",
        "What a stop promises",
        _latched,
    ),
    Rule(
        "outcome",
        "A motion that failed is not reported as a success.",
        "How a motion ended",
        _outcome,
        (BARE_COMMAND,),
    ),
    Rule("units", "Nothing is shown in units while the scale does not hold.", "0120", _workshop),
    Rule("saved", "A restore saves only what it has read back.", "What a report means", _workshop),
    Rule(
        "automation",
        "Drives that automation moved are stopped at its early end, and no others.",
        "What a report means",
        _automation,
    ),
    Rule(
        "spared",
        "A line that was refused, reads, or sets a value stops no drive.",
        "What a report means",
        _spared,
    ),
    Rule(
        "stranger",
        "A device that did not identify itself gets only what was typed for it, and the stop of a person.",
        "0108",
        _stranger,
    ),
    Rule(
        "asked",
        "A line that asks first is executed after a yes only.",
        "Lines that ask first",
        _asked,
        (BARE_COMMAND,),
    ),
    Rule(
        "stored",
        "In program mode a line is stored, not executed.",
        "Lines that ask first",
        _stored,
        (BARE_COMMAND,),
    ),
    Rule(
        "programs",
        "A download leaves the old program, the new one, or a backup that is named.",
        "What a report means",
        _programs,
        (BARE_COMMAND, ASTRAY),
    ),
    Rule("raw", "What leaves in raw mode is what was typed, and stops.", "What a report means", _raw),
)
