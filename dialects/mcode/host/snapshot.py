"""Reading everything of an MCode drive: settings, program, counters and inputs. Nothing moves, and nothing is cleared.

A locked program is not asked for, as the refusal would run a resident OE subroutine (MCode reference 5.1.75).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from multidrop.dialects.codec import Procedure
from multidrop.dialects.held import LOCKED
from multidrop.dialects.mcode.host import parameters
from multidrop.dialects.mcode.host.attend import attend
from multidrop.dialects.mcode.host.exchange import answered
from multidrop.dialects.mcode.host.signatures import question, value
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.manual.parameters import exact
from multidrop.dialects.mcode.manual.points import EXPANDED_INPUTS, INPUTS
from multidrop.dialects.mcode.manual.statements import UNNAMED
from multidrop.dialects.mcode.manual.table import words
from multidrop.dialects.parameters import Progress, Readings
from multidrop.dialects.snapshots import Levels, Snapshot
from multidrop.dialects.state import DriveState

BAUDS = {48: 4800, 96: 9600, 19: 19200, 38: 38400, 11: 115200}
"""By BD (5.1.9)."""
ASKED = ("P", "C1", "C2", "V", "BY", "IN", "I5")
"""The words of the state, as far as the product has them."""
EXPANDED = "MDIX"
OUTPUT_TYPES = range(16, 30)
"""Types of a point that is not an input (MDrivePlus: S<n>)."""
_LISTED = re.compile(r"(\d+)\s+(\S.*)")


def take(state: MCodeState, progress: Progress) -> Procedure[Snapshot]:
    """Read a drive. Raises Refused where it would store the questions, or NoAnswer."""
    readings = yield from parameters.read(state, progress)
    now = yield from _now(state)
    program, remarks = yield from _program(state, readings, running=bool(now["BY"]))
    found = made(state, readings, now)
    return replace(
        found,
        name=state.name or UNNAMED,
        party=state.codec.party,
        baud=BAUDS.get(_whole(readings, "BD"), 0),
        program=program,
        remarks=(*remarks, *found.remarks),
    )


def made(state: DriveState, readings: Readings, now: Mapping[str, int]) -> Snapshot:
    """Make the record of a drive from its settings and its state of the moment, by word."""
    remarks = []
    if now["V"]:
        remarks.append(f"moving at V={now['V']} while it was read: its position is one of that moment")
    if now["BY"]:
        remarks.append("a program ran while it was read")
    levels = _levels(state.product, readings)
    return Snapshot(
        kind="mcode",
        product=state.product,
        part=state.part,
        version=state.version,
        serial=state.serial,
        name=UNNAMED,
        readings=readings,
        counters=_counters(readings, now),
        inputs=levels.of(now["IN"]),
        levels=levels,
        active=bool(now["V"] or now["BY"]),
        analog=(now["I5"],) if "I5" in now else (),
        remarks=tuple(remarks),
    )


def _now(state: MCodeState) -> Procedure[dict[str, int]]:
    """Read counters, motion and inputs in one print, so that they belong together."""
    known, whole = words(state.product), exact(state.product)
    asked = [word for word in ASKED if word in known and (state.product in known[word].products or not whole)]
    items, pattern = '," ",'.join(asked), " ".join(r"-?\d{1,10}" for _ in asked)
    yield from attend(state, question(state, items, pattern))
    reply = yield from answered(state, question(state, items, pattern))
    return dict(zip(asked, map(int, value(state, reply).split()), strict=True))


def _program(
    state: MCodeState, readings: Readings, running: bool
) -> Procedure[tuple[tuple[tuple[int, str], ...], list[str]]]:
    """Read the listing; one that a running program's prints may have come into is read twice."""
    if _whole(readings, "LK"):
        return (), [f"not read: {LOCKED}"]
    first = yield from parameters.listed(state, "L")
    if running and first != (yield from parameters.listed(state, "L")):
        return (), ["its program was not read: it runs, and its prints came between the lines"]
    found = [_LISTED.fullmatch(line.strip()) for line in first]
    lost = [line for line, row in zip(first, found, strict=True) if row is None]
    doubts = [f"its listing has a line that is not a program line: {line!r}" for line in lost]
    return tuple((int(row[1]), row[2]) for row in found if row is not None), doubts


def _counters(readings: Readings, now: Mapping[str, int]) -> Mapping[str, tuple[int, ...]]:
    """P, and the counter that P is not."""
    counts = _whole(readings, "EE") and not _whole(readings, "AS")
    other = "C1" if counts else "C2"
    return {"position": (now["P"],)} | ({other: (now[other],)} if other in now else {})


def _levels(product: str, readings: Readings) -> Levels:
    points = EXPANDED_INPUTS if product == EXPANDED else INPUTS
    types = {name: held for name, held in readings.values.items() if isinstance(held, tuple)}
    outputs = {n for n in points if types.get(f"S{n}", (0,))[0] in OUTPUT_TYPES}
    return Levels("IN", tuple((n, bit) for bit, n in enumerate(points) if n not in outputs))


def _whole(readings: Readings, name: str) -> int:
    found = readings.values.get(name, 0)
    return found if isinstance(found, int) else 0
