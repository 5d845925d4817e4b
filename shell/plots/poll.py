"""`multidrop poll`: values of drives in a row every so many seconds."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Sequence
from datetime import UTC
from itertools import count
from typing import NamedTuple

from multidrop.base.errors import Diagnostic, DriveError, TransportLost
from multidrop.dialects import Priority
from multidrop.drives.drive import Drive
from multidrop.shell.batch import runner
from multidrop.shell.params.work import targets
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import write
from multidrop.shell.workspace import address_of

WIDTH = 11
STAMP = 24


def lost(workspace: Session) -> TransportLost | None:
    """The loss of a bus that is not tried again."""
    trying = workspace.reconnections.trying
    return next((bus.lost for bus in workspace.buses.values() if bus.lost and bus.name not in trying), None)


class PollOptions(NamedTuple):
    """What a person asks for."""

    names: Sequence[str]
    drives: str
    """`a,b`, or all."""
    every: float
    """The time from one row to the next, s."""
    rows: int | None
    json: bool


def poll(url: str, asked: PollOptions, reconnect: bool) -> int:
    """Poll until a signal, which ends it well, or for a number of rows; return the exit code."""
    return runner.run([url], lambda session: _poll(session, asked), interrupted=0, reconnect=reconnect, replies=False)


async def _poll(session: Session, asked: PollOptions) -> None:
    wanted = _wanted(session, asked)
    for drive, word in wanted:
        await drive.run(drive.family.values.first(word), typed=True)
    columns = [f"{address_of(session, drive).rstrip(':')}.{word}" for drive, word in wanted]
    if not asked.json:
        write(sys.stdout, f"{'time':<{STAMP}}" + "".join(f"  {name:>{WIDTH}}" for name in columns))
    due = session.now()
    for row in count(1):
        values = [await _value(session, *value_of) for value_of in wanted]
        now = session.wall(session.now()).astimezone(UTC)
        stamp = now.isoformat(timespec="milliseconds").replace("+00:00", "Z")
        if asked.json:
            write(
                sys.stdout, *(_object(stamp, *value_of, value) for value_of, value in zip(wanted, values, strict=True))
            )
        else:
            shown = ["-" if value is None else f"{value:.10g}" for value in values]
            cells = (f"  {text:>{max(WIDTH, len(name))}}" for text, name in zip(shown, columns, strict=True))
            write(sys.stdout, f"{stamp:<{STAMP}}" + "".join(cells))
        if row == asked.rows:
            return
        due = max(due + asked.every, session.now())
        await asyncio.sleep(due - session.now())


def _wanted(session: Session, asked: PollOptions) -> list[tuple[Drive, str]]:
    """Each value: a word of each drive, or of the one that precedes its dot. Raises Diagnostic; sends nothing."""
    wanted: dict[tuple[Drive, str], None] = {}
    drives = targets(session, session.origin, asked.drives, "values")
    for name in asked.names:
        target, _, word = name.rpartition(".")
        if not word:
            raise Diagnostic(f"no value in {name!r}", hint="valid: NAME or ADDR.NAME, as P, b.VM, press:b.I1")
        for drive in targets(session, session.origin, target, "values") if target else drives:
            wanted[drive, drive.family.values.check(word)] = None
    return list(wanted)


async def _value(session: Session, drive: Drive, word: str) -> float | None:
    """Read a value; None where the drive does not give it now. Raises TransportLost for a line that stays lost."""
    try:
        return await drive.run(drive.family.values.again(word, Priority.POLL), typed=True)
    except (DriveError, TransportLost) as failure:
        if gone := lost(session):
            raise gone from None
        session.notify(f"{word}: {failure}", bus=drive.link.name, warning=True)
        return None


def _object(stamp: str, drive: Drive, word: str, value: float | None) -> str:
    number = int(value) if value is not None and value.is_integer() else value
    return json.dumps({"time": stamp, "bus": drive.link.name, "drive": drive.address, "name": word, "value": number})
