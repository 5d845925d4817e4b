"""Programs of a controller under observation: SR starts, pauses and continues, SASTAT and SPC report.

A controller neither traces nor steps, and has no break points; the host reads its program counter now and then. SPC is
the address of a compiled line. (PMX-2ED-SA manual 7.19.2, 7.19.3.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from multidrop.dialects.codec import Procedure
from multidrop.dialects.debugging import Debugging, Look, Neighbours, Row
from multidrop.dialects.errors import Diagnostic, Inexpressible, Refused
from multidrop.dialects.pmx.host.codec import PmxState
from multidrop.dialects.pmx.host.exchange import answered, number, who
from multidrop.dialects.pmx.host.operations import perform
from multidrop.dialects.pmx.host.programs import listing
from multidrop.dialects.pmx.manual import program_file, script_checker
from multidrop.dialects.pmx.manual.program_file import RAW, Undecodable
from multidrop.dialects.pmx.manual.table import lookup

RUNNING, PAUSED = 1, 2
"""Values of SASTAT."""
START, PAUSE, CONTINUE = 1, 2, 3
"""Values of SR."""
NO_STEP = "a PMX has no single step: /break now pauses a program, /continue goes on"


def rows(state: PmxState) -> Procedure[tuple[Row, ...]]:
    """Read the compiled lines in the controller; where they can be decompiled, the statements at their first lines."""
    lines = yield from listing(state)
    return _rows(tuple(Row(int(found[1]), found[2]) for line in lines if (found := RAW.fullmatch(line))))


def _rows(held: tuple[Row, ...]) -> tuple[Row, ...]:
    try:
        script = program_file.readable(f"SA{row.address}={row.text}" for row in held)
    except Undecodable:
        script = []
    if not script:
        return held
    source = script_checker.read("\n".join(script), "program").source
    first = {line: at for at, line in reversed(list(enumerate(source)))}
    return tuple(Row(first[line], script[line - 1]) for line in sorted(first))


def idle(state: PmxState, program: str, neighbours: Neighbours | None) -> Procedure[None]:
    if neighbours is None:
        raise _lacks(state, NO_STEP)
    if (yield from _status(state, program)) in (RUNNING, PAUSED):
        raise Refused(f"{who(state)}: program {program} runs already; not started; SR{program}=0 ends it")


def trace(state: PmxState, program: str) -> Procedure[None]:
    yield from perform(state, f"SR{_program(program)}={START}")


def look(state: PmxState, program: str) -> Procedure[Look]:
    status = yield from _status(state, program)
    active = status in (RUNNING, PAUSED)
    address = (yield from number(state, f"SPC{_program(program)}")) if active else None
    return Look(active, status == PAUSED, address)


def waits(state: PmxState, program: str, last: Row | None) -> Procedure[None]:
    if (yield from _status(state, program)) != PAUSED:
        raise Refused(f"{who(state)}: program {_program(program)} is not paused; nothing was sent")


def go_on(state: PmxState, program: str) -> Procedure[None]:
    yield from perform(state, f"SR{_program(program)}={CONTINUE}")


def break_now(state: PmxState, program: str) -> Procedure[None]:
    if (yield from _status(state, program)) != RUNNING:
        raise Refused(f"{who(state)}: program {_program(program)} does not run; nothing was sent")
    yield from perform(state, f"SR{_program(program)}={PAUSE}")


def _status(state: PmxState, program: str) -> Procedure[int]:
    return (yield from number(state, f"SASTAT{_program(program)}"))


def _program(place: str) -> str:
    """The number of a program; 0 where none is named."""
    if (place or "0") not in ("0", "1"):
        raise Diagnostic(f"no program {place}", "", "valid: 0 or 1")
    return place or "0"


def no_step(state: PmxState, *_: object) -> Procedure[Any]:
    raise _lacks(state, NO_STEP)
    yield  # a procedure


def no_break(state: PmxState, *_: object) -> Procedure[None]:
    raise _lacks(state, "a PMX has no break points: /break now pauses a program; program test --break has them")
    yield  # a procedure


def _lacks(state: PmxState, what: str) -> Inexpressible:
    return Inexpressible(f"{who(state)}: {what}; nothing was sent")


def never_broken(*_: object) -> Procedure[int | None]:
    return None
    yield  # a procedure


def check_names(state: PmxState, names: Sequence[str]) -> None:
    for name in names:
        row = lookup(name)
        if row is None or "R" not in row.access:
            raise Diagnostic(f"{name} cannot be watched: it reads no value", "", "valid: V0 to V63, PX, DI and others")


def values(state: PmxState, names: Sequence[str]) -> Procedure[Mapping[str, str]]:
    found = {}
    for name in names:
        reply = yield from answered(state, state.codec.request(state.address, name))
        found[name] = reply.text
    return found


DEBUGGING = Debugging(
    listing=rows,
    rows=lambda held: _rows(tuple(Row(*line) for line in held.lines)),
    entry=lambda program: "0",
    address=lambda program, place: None,
    idle=idle,
    trace=trace,
    begin=no_step,
    waits=waits,
    forget=lambda state: None,
    step=no_step,
    go_on=go_on,
    look=look,
    break_at=no_break,
    break_off=no_break,
    break_now=break_now,
    broken=never_broken,
    hold=lambda text: 0.0,
    names=check_names,
    values=values,
    traced=lambda line: None,
    no_step=NO_STEP,
)
