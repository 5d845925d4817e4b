"""What is read of a controller beside its settings: conditions, values for plots, and all of it for a snapshot.

A controller prints one value a command. So StepNLoop's state and delta are read only where it is on, and a program
counter only while the program runs. A number means a position after ABS and a distance after INC, and another client
may have sent either: each move of a control sends ABS first. (PMX-2ED-SA manual 7.5 to 7.8, 7.10, 7.12 to 7.14, 7.17,
7.19.3, table 9.0.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from multidrop.dialects.codec import Priority, Procedure, Request
from multidrop.dialects.errors import Diagnostic, Refused
from multidrop.dialects.parameters import Progress, Value
from multidrop.dialects.parameters import number as number_in
from multidrop.dialects.pmx.host import parameters
from multidrop.dialects.pmx.host.codec import PmxState
from multidrop.dialects.pmx.host.exchange import answered, beyond_doubt, number, who
from multidrop.dialects.pmx.host.operations import PROGRAMS
from multidrop.dialects.pmx.host.programs import listing
from multidrop.dialects.pmx.manual import status as words
from multidrop.dialects.pmx.manual.program_file import RAW
from multidrop.dialects.pmx.manual.table import AXES, lookup
from multidrop.dialects.state import DriveState
from multidrop.dialects.values import (
    BY,
    DISABLE,
    ENABLE,
    HOME_MINUS,
    HOME_PLUS,
    STOP,
    TO,
    Conditions,
    Control,
    Controls,
    Facts,
    Lamp,
    Levels,
    Pace,
    Part,
    PolledValues,
    Reader,
    Snapshot,
    printed_number,
)

RUNNING, PAUSED = 1, 2
"""Values of SASTAT at which SPC counts."""
SPEEDS = ("LSPD", "HSPD", "ACC", "DEC")
POINTS = 8
"""Inputs, and outputs."""
ON_AXIS = ((1 << 6, "home"), (1 << 4, "lim+"), (1 << 5, "lim-"), (1 << 9, "Z"))
"""The bits of a motor status that are switches of the axis."""
DRIVERS = {"X": 1, "Y": 2}
"""The bits of EO."""
BAUDS = {1: 9600, 2: 19200, 3: 38400, 4: 57600, 5: 115200}
"""By DB (table 6.1)."""
POLARITY = 1 << 10
"""The bit of POLX that inverts the inputs."""


def parts(state: PmxState, facts: Facts) -> Sequence[Part[PmxState]]:
    found = []
    for axis in AXES:
        loop = (f"SLS{axis}", f"DX{axis}") if facts.get(f"SL{axis}") else ()
        found.append(Part(axis, partial(_facts, names=(f"MST{axis}", *loop))))
    found += [Part("points", partial(_facts, names=("DI", "DO", "EO"))), Part("programs", _programs)]
    found += [Part(f"settings {axis}", partial(_facts, names=(f"SL{axis}",)), slow=True) for axis in AXES]
    named = [each + axis for axis in ("", *AXES) for each in SPEEDS]
    return [*found, *(Part(name, partial(_facts, names=(name,)), slow=True) for name in (*named, "EDEC"))]


def _facts(state: PmxState, names: Sequence[str]) -> Procedure[dict[str, Value]]:
    doubts: list[Request] = []
    found: dict[str, Value] = {}
    for name in names:
        found[name] = yield from number(state, name, Priority.POLL, doubts)
    if doubts:
        yield from beyond_doubt(state, doubts[0])
    return found


def _programs(state: PmxState) -> Procedure[Facts]:
    found = yield from _facts(state, [f"SASTAT{program}" for program in PROGRAMS])
    active = [f"SPC{program}" for program in PROGRAMS if found[f"SASTAT{program}"] in (RUNNING, PAUSED)]
    return found | (yield from _facts(state, active))


def fold(state: PmxState, facts: Facts) -> tuple[Conditions, ...]:
    """The conditions of both axes; points and programs are with the first."""
    whole = {name: value for name, value in facts.items() if isinstance(value, int)}
    one, other = (_of_axis(axis, whole) for axis in AXES)
    lamps = list(one.lamps)
    for word, output in (("DI", False), ("DO", True)):
        bits = whole.get(word)
        on = [None if bits is None else bool(bits >> n & 1) for n in range(POINTS)]
        lamps += [Lamp(str(n + 1), "", each, output) for n, each in enumerate(on)]
    states = [whole.get(f"SASTAT{n}") for n in PROGRAMS]
    active = [n for n in PROGRAMS if states[n] in (RUNNING, PAUSED)]
    failed = ", ".join(str(n) for n in PROGRAMS if states[n] == 4)
    one = replace(
        one,
        lamps=tuple(lamps),
        program=", ".join(f"{n} {words.program_words(states[n] or 0)}" for n in active),
        runs=None if None in states else RUNNING in states,  # a paused one moves nothing
        line=", ".join(str(facts.get(f"SPC{n}", "")) for n in active),
        more=(*one.more, *([("program", f"{failed} stopped by an error")] if failed else ())),
    )
    return one, other


def _of_axis(axis: str, facts: Mapping[str, int]) -> Conditions:
    status, loop, on = facts.get(f"MST{axis}"), facts.get(f"SLS{axis}"), facts.get("EO")
    more = []
    if status is not None:
        more.append(("status", ", ".join(words.status_words(status))))
    if loop is not None:
        more.append(("StepNLoop", words.loop_words(loop)))
    if f"DX{axis}" in facts:
        more.append(("delta", str(facts[f"DX{axis}"])))
    code = (status or 0) & words.LIMIT_ERROR
    text = words.trouble_words(code)
    if loop is not None and loop in words.LOOP_ERRORS:
        code, text = loop, f"StepNLoop {words.loop_words(loop)}"
    return Conditions(
        axis=axis.lower(),
        lamps=tuple(Lamp("", each, None if status is None else bool(status & bit)) for bit, each in ON_AXIS),
        error=code,
        error_text=text,
        disabled=f"EO{DRIVERS[axis]}=0" if on is not None and not on & DRIVERS[axis] else "",
        more=tuple(more),
        unit="counts" if facts.get(f"SL{axis}") else "pulses",
        pace=_pace(axis, facts),
    )


def _pace(axis: str, facts: Mapping[str, int]) -> Pace | None:
    """The ramps of a move: an axis's own values count unless they are 0. Times are in ms."""
    low, high, up, down = (facts.get(name + axis) or facts.get(name, 0) for name in SPEEDS)
    down = down if facts.get("EDEC") else up
    if not (high > low and up and down):
        return None
    return Pace(low, high, (high - low) / up * 1000, (high - low) / down * 1000)


READER = Reader(parts=parts, fold=fold)


def check(state: PmxState, word: str) -> str:
    row = lookup(word)
    if row is None or "R" not in row.access:
        raise Diagnostic(f"{word} cannot be plotted: it reads no value", hint="valid: V0 to V63, DI, SSPD and others")
    return word.upper()


def again(state: PmxState, word: str, priority: Priority) -> Procedure[float]:
    reply = yield from answered(state, replace(state.codec.request(state.address, word), priority=priority))
    try:
        return printed_number(who(state), word, reply.text)
    except ValueError as wrong:
        raise Refused(str(wrong)) from None


READINGS = PolledValues(check=check, first=lambda state, word: again(state, word, Priority.OPERATOR), again=again)


def take(state: PmxState, progress: Progress) -> Procedure[Snapshot]:
    """Read a controller. Raises NoAnswer."""
    readings = yield from parameters.read(state, progress)
    identity = yield from answered(state, state.codec.request(state.address, "ID"))
    remarks = []
    for axis in AXES:
        if (yield from number(state, f"MST{axis}")) & words.MOVING:
            remarks.append(f"{axis} moved while it was read: its position is one of that moment")
    for program in PROGRAMS:
        if (yield from number(state, f"SASTAT{program}")) == RUNNING:
            remarks.append(f"program {program} ran while it was read")
    counters = {}
    for key, word in (("position", "P"), ("encoder", "E")):
        counters[key] = (yield from number(state, f"{word}X")), (yield from number(state, f"{word}Y"))
    analog = (yield from number(state, "AI1")), (yield from number(state, "AI2"))
    values = readings.values
    # A bit of DI is 1 if the input is at ground, or with the other polarity if it is not.
    inverted = not int(number_in(values.get("POLX"))) & POLARITY
    levels = Levels("DI", tuple((n + 1, n) for n in range(POINTS)), inverted=inverted)
    listed = yield from listing(state)
    return Snapshot(
        kind="pmx",
        product="PMX",
        part=identity.text,
        version=state.version,
        name=str(values.get("DN", state.name))[-2:] or state.address,
        baud=BAUDS.get(int(number_in(values.get("DB"))), 0),
        readings=readings,
        program=tuple((int(row[1]), row[2]) for line in listed if (row := RAW.fullmatch(line))),
        counters=counters,
        inputs=levels.of((yield from number(state, levels.word))),
        levels=levels,
        active=bool(remarks),
        analog=analog,
        remarks=tuple(remarks),
    )


def controls(state: DriveState, axis: str) -> Controls:
    name = axis.upper()
    number = AXES.index(name) + 1
    return {
        BY: Control(("ABS", name + "{to}"), "numbers are positions from then on"),
        TO: Control(("ABS", name + "{to}"), "numbers are positions from then on"),
        HOME_MINUS: Control((f"H{name}-",), "on the home input, at high speed"),
        HOME_PLUS: Control((f"H{name}+",), "on the home input, at high speed"),
        STOP: Control((f"STOP{name}",), "slows down; a program goes on"),
        ENABLE: Control((f"EO{number}=1",), "current in the motor"),
        DISABLE: Control((f"EO{number}=0",), "no current: nothing holds the load"),
    }
