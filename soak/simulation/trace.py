"""The trace of a history for a person: times, bytes as text and in hex, keys, and what each side believed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from multidrop.base.text import visible
from soak.simulation.records.commands import Command
from soak.simulation.records.history import Executed, History

WIDTH = 40
"""Characters of text beside which the hex stands."""
BYTES = "<>"


def readable(history: History) -> Iterator[str]:
    """The rows of a trace that was kept: what happened in its order, then each command with both records of it."""
    for kind, rows in groupby(history.lines, key=lambda row: row[1]):
        if kind != "key" and kind[0] not in BYTES:
            yield from (_row(at, kind, text) for at, _, text in rows)
            continue
        (at, _, first), *more = rows
        data = bytes.fromhex("".join([first, *(text for _, _, text in more)]))
        if kind == "key" and not data:
            continue
        yield _row(at, kind, f"{repr(data)[1:]:{WIDTH}} {data.hex(' ')}")
    yield ""
    yield from _beliefs(history)


def _row(at: float, kind: str, text: str) -> str:
    return f"{at:12.6f} {kind:9} {visible(text)}"


def _beliefs(history: History) -> Iterator[str]:
    """The host's word about each command, and the drive's own record."""
    for each in history.commands.values():
        executed = [f"{done.at:.6f}" for done in history.executed if _same(done, each)]
        drive = f"executed at {', '.join(executed)}" if executed else "did not execute it"
        host = f"the host: {each.outcome.value}" + f" ({each.said})" * bool(each.said and each.said != "()")
        yield f"{each.line}:{each.drive} {each.text!r}, typed at {each.typed:.6f}; {host}; the drive {drive}"


def _same(done: Executed, command: Command) -> bool:
    return (done.line, done.drive, done.text) == (command.line, command.drive, command.text)
