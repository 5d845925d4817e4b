"""What is read of a controller beside its settings: conditions, values for plots, and all of it for a snapshot.

A controller prints one value a command. So StepNLoop's state and delta are read only where it is on, and a program
counter only while the program runs. (PMX-2ED-SA manual 7.12 to 7.14, 7.17, 7.19.3, table 9.0.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

from multidrop.dialects.codec import Priority, Procedure, Request
from multidrop.dialects.errors import Diagnostic, Refused
from multidrop.dialects.parameters import Progress
from multidrop.dialects.parameters import number as whole
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
INPUTS, OUTPUTS = 8, 8
ON_AXIS = ((1 << 6, "home"), (1 << 4, "lim+"), (1 << 5, "lim-"), (1 << 9, "Z"))
"""The bits of a motor status that are switches of the axis."""
DRIVERS = {"X": 1, "Y": 2}
"""The bits of EO."""


def parts(state: PmxState, facts: Facts) -> Sequence[Part[PmxState]]:
    """The parts of a controller."""
    found = [Part(axis, partial(_axis, axis=axis, loop=bool(facts.get(f"SL{axis}")))) for axis in AXES]
    found += [Part("points", _points), Part("programs", _programs)]
    found += [Part(f"settings {axis}", partial(_facts, names=(f"SL{axis}",)), slow=True) for axis in AXES]
    named = [each + axis for axis in ("", *AXES) for each in SPEEDS]
    return [*found, *(Part(name, partial(_facts, names=(name,)), slow=True) for name in (*named, "EDEC"))]


def _facts(state: PmxState, names: Sequence[str]) -> Procedure[Facts]:
    doubts: list[Request] = []
    found = {}
    for name in names:
        found[name] = yield from number(state, name, Priority.POLL, doubts)
    if doubts:
        yield from beyond_doubt(state, doubts[0])
    return found


def _axis(state: PmxState, axis: str, loop: bool) -> Procedure[Facts]:
    return (yield from _facts(state, [f"MST{axis}", *([f"SLS{axis}", f"DX{axis}"] if loop else ())]))


def _points(state: PmxState) -> Procedure[Facts]:
    return (yield from _facts(state, ("DI", "DO", "EO")))


def _programs(state: PmxState) -> Procedure[Facts]:
    found = dict((yield from _facts(state, [f"SASTAT{program}" for program in PROGRAMS])))
    active = [f"SPC{program}" for program in PROGRAMS if found[f"SASTAT{program}"] in (RUNNING, PAUSED)]
    return found | dict((yield from _facts(state, active)))


def fold(state: PmxState, facts: Facts) -> tuple[Conditions, ...]:
    """The conditions of both axes; points and programs are with the first."""
    return tuple(_conditions(axis, facts) for axis in AXES)


def _conditions(axis: str, facts: Facts) -> Conditions:
    first = axis == AXES[0]
    status = int(whole(facts.get(f"MST{axis}")))
    loop = facts.get(f"SLS{axis}")
    code, text = _error(status, loop if isinstance(loop, int) else None)
    running, line = _shown_programs(facts) if first else ("", "")
    on = facts.get("EO")
    return Conditions(
        axis=axis.lower(),
        lamps=(*_switches(axis, facts), *(_shared(facts) if first else ())),
        error=code,
        error_text=text,
        program=running,
        runs=_runs(facts) if first else None,
        line=line,
        disabled=f"EO{DRIVERS[axis]}=0" if isinstance(on, int) and not on & DRIVERS[axis] else "",
        more=tuple(_more(axis, facts)),
        unit="counts" if facts.get(f"SL{axis}") else "pulses",
        pace=_pace(axis, facts),
    )


def _error(status: int, loop: int | None) -> tuple[int, str]:
    """The error of an axis: the bits of its motor status, or the state of StepNLoop."""
    if loop in words.LOOP_ERRORS and loop is not None:
        return loop, f"StepNLoop {words.loop_words(loop)}"
    return status & words.LIMIT_ERROR, words.trouble_words(status & words.LIMIT_ERROR)


def _switches(axis: str, facts: Facts) -> Iterator[Lamp]:
    status = facts.get(f"MST{axis}")
    for bit, function in ON_AXIS:
        yield Lamp("", function, bool(status & bit) if isinstance(status, int) else None)


def _shared(facts: Facts) -> Iterator[Lamp]:
    for word, count, output in (("DI", INPUTS, False), ("DO", OUTPUTS, True)):
        bits = facts.get(word)
        for n in range(count):
            yield Lamp(str(n + 1), "", bool(bits >> n & 1) if isinstance(bits, int) else None, output)


def _runs(facts: Facts) -> bool | None:
    """Whether a program runs; a paused one moves nothing."""
    states = [facts.get(f"SASTAT{n}") for n in PROGRAMS]
    return None if None in states else RUNNING in states


def _shown_programs(facts: Facts) -> tuple[str, str]:
    """The programs that run or pause, and their program counters."""
    states = {n: facts.get(f"SASTAT{n}") for n in PROGRAMS}
    active = [n for n in PROGRAMS if states[n] in (RUNNING, PAUSED)]
    shown = ", ".join(f"{n} {words.program_words(int(whole(states[n])))}" for n in active)
    return shown, ", ".join(str(facts.get(f"SPC{n}", "")) for n in active)


def _more(axis: str, facts: Facts) -> Iterator[tuple[str, str]]:
    status = facts.get(f"MST{axis}")
    if isinstance(status, int):
        yield "status", ", ".join(words.status_words(status))
    loop = facts.get(f"SLS{axis}")
    if isinstance(loop, int):
        yield "StepNLoop", words.loop_words(loop)
    if isinstance(delta := facts.get(f"DX{axis}"), int):
        yield "delta", str(delta)
    failed = [str(n) for n in PROGRAMS if facts.get(f"SASTAT{n}") == 4]
    if failed and axis == AXES[0]:
        yield "program", f"{', '.join(failed)} stopped by an error"


def _pace(axis: str, facts: Facts) -> Pace | None:
    """The ramps of a move: an axis's own values count unless they are 0. Times are in ms."""
    values = [whole(facts.get(name + axis)) or whole(facts.get(name)) for name in SPEEDS]
    low, high, up, down = values
    down = down if facts.get("EDEC") else up
    if not (high > low and up and down):
        return None
    return Pace(low, high, (high - low) / up * 1000, (high - low) / down * 1000)


READER = Reader(parts=parts, fold=fold)


def check(state: PmxState, word: str) -> str:
    """Check that a word reads a value."""
    row = lookup(word)
    if row is None or "R" not in row.access:
        raise Diagnostic(f"{word} cannot be plotted: it reads no value", hint="valid: V0 to V63, DI, SSPD and others")
    return word.upper()


def again(state: PmxState, word: str, priority: Priority) -> Procedure[float]:
    """Read a value."""
    reply = yield from answered(state, replace(state.codec.request(state.address, word), priority=priority))
    try:
        return printed_number(who(state), word, reply.text)
    except ValueError as wrong:
        raise Refused(str(wrong)) from None


READINGS = PolledValues(check=check, first=lambda state, word: again(state, word, Priority.OPERATOR), again=again)


BAUDS = {1: 9600, 2: 19200, 3: 38400, 4: 57600, 5: 115200}
"""By DB (table 6.1)."""
INPUT_NUMBERS = range(1, 9)
POLARITY = 1 << 10
"""The bit of POLX that inverts the inputs."""


def take(state: PmxState, progress: Progress) -> Procedure[Snapshot]:
    """Read a controller. Raises NoAnswer."""
    readings = yield from parameters.read(state, progress)
    identity = yield from answered(state, state.codec.request(state.address, "ID"))
    remarks = yield from _activity(state)
    counters = {}
    for key, word in (("position", "P"), ("encoder", "E")):
        counters[key] = (yield from number(state, f"{word}X")), (yield from number(state, f"{word}Y"))
    analog = (yield from number(state, "AI1")), (yield from number(state, "AI2"))
    values = readings.values
    levels = _levels(_whole(values.get("POLX")))
    return Snapshot(
        kind="pmx",
        product="PMX",
        part=identity.text,
        version=state.version,
        name=str(values.get("DN", state.name))[-2:] or state.address,
        baud=BAUDS.get(_whole(values.get("DB")), 0),
        readings=readings,
        program=(yield from _program(state)),
        counters=counters,
        inputs=levels.of((yield from number(state, levels.word))),
        levels=levels,
        active=bool(remarks),
        analog=analog,
        remarks=tuple(remarks),
    )


def _activity(state: PmxState) -> Procedure[list[str]]:
    remarks = []
    for axis in AXES:
        if (yield from number(state, f"MST{axis}")) & words.MOVING:
            remarks.append(f"{axis} moved while it was read: its position is one of that moment")
    for program in PROGRAMS:
        if (yield from number(state, f"SASTAT{program}")) == RUNNING:
            remarks.append(f"program {program} ran while it was read")
    return remarks


def _program(state: PmxState) -> Procedure[tuple[tuple[int, str], ...]]:
    listed = yield from listing(state)
    return tuple((int(row[1]), row[2]) for line in listed if (row := RAW.fullmatch(line)))


def _levels(polarity: int) -> Levels:
    """A bit of DI is 1 if the input is at ground, or with the other polarity if it is not."""
    return Levels("DI", tuple((n, n - 1) for n in INPUT_NUMBERS), inverted=not polarity & POLARITY)


def _whole(held: object) -> int:
    return held if isinstance(held, int) else 0


def controls(state: DriveState, axis: str) -> Controls:
    """The controls of one axis."""
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
