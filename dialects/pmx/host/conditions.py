"""The conditions of a controller, one short part for each axis, for its points and for its programs.

A controller prints one value a command. So StepNLoop's state and delta are read only where it is on, and a program
counter only while the program runs. (PMX-2ED-SA manual 7.12 to 7.14, 7.17, 7.19.3, table 9.0.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from multidrop.dialects.codec import Priority, Procedure, Request
from multidrop.dialects.conditions import Conditions, Facts, Lamp, Pace, Part, Reader
from multidrop.dialects.parameters import number as whole
from multidrop.dialects.pmx.host.exchange import beyond_doubt, number
from multidrop.dialects.pmx.host.operations import PROGRAMS
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.manual import status as words
from multidrop.dialects.pmx.manual.table import AXES

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
    found += [Part(f"settings {axis}", partial(_read, names=(f"SL{axis}",)), slow=True) for axis in AXES]
    named = [each + axis for axis in ("", *AXES) for each in SPEEDS]
    return [*found, *(Part(name, partial(_read, names=(name,)), slow=True) for name in (*named, "EDEC"))]


def _read(state: PmxState, names: Sequence[str]) -> Procedure[Facts]:
    doubts: list[Request] = []
    found = {}
    for name in names:
        found[name] = yield from number(state, name, Priority.POLL, doubts)
    if doubts:
        yield from beyond_doubt(state, doubts[0])
    return found


def _axis(state: PmxState, axis: str, loop: bool) -> Procedure[Facts]:
    return (yield from _read(state, [f"MST{axis}", *([f"SLS{axis}", f"DX{axis}"] if loop else ())]))


def _points(state: PmxState) -> Procedure[Facts]:
    return (yield from _read(state, ("DI", "DO", "EO")))


def _programs(state: PmxState) -> Procedure[Facts]:
    found = dict((yield from _read(state, [f"SASTAT{program}" for program in PROGRAMS])))
    active = [f"SPC{program}" for program in PROGRAMS if found[f"SASTAT{program}"] in (RUNNING, PAUSED)]
    return found | dict((yield from _read(state, active)))


def fold(state: PmxState, facts: Facts) -> tuple[Conditions, ...]:
    """The conditions of both axes; points and programs are with the first."""
    return tuple(_conditions(axis, facts) for axis in AXES)


def _conditions(axis: str, facts: Facts) -> Conditions:
    first = axis == AXES[0]
    status = int(whole(facts.get(f"MST{axis}")))
    loop = facts.get(f"SLS{axis}")
    code, text = _error(status, loop if isinstance(loop, int) else None)
    running, line = _program(facts) if first else ("", "")
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
        return loop, f"StepNLoop {words.loop(loop)}"
    return status & words.LIMIT_ERROR, words.remarkable(status & words.LIMIT_ERROR)


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


def _program(facts: Facts) -> tuple[str, str]:
    """The programs that run or pause, and their program counters."""
    states = {n: facts.get(f"SASTAT{n}") for n in PROGRAMS}
    active = [n for n in PROGRAMS if states[n] in (RUNNING, PAUSED)]
    shown = ", ".join(f"{n} {words.program(int(whole(states[n])))}" for n in active)
    return shown, ", ".join(str(facts.get(f"SPC{n}", "")) for n in active)


def _more(axis: str, facts: Facts) -> Iterator[tuple[str, str]]:
    status = facts.get(f"MST{axis}")
    if isinstance(status, int):
        yield "status", ", ".join(words.words(status))
    loop = facts.get(f"SLS{axis}")
    if isinstance(loop, int):
        yield "StepNLoop", words.loop(loop)
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
