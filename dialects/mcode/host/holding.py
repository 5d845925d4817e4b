"""Reading the programs of an MCode drive, with its labels and variables, and ending them.

A locked program is not listed: the drive refuses L with error 44, and an error runs a resident OE subroutine. So the
host reads LK first. (MCode reference 5.1.35, 5.1.75, 5.1.134.)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Diagnostic, NoAnswer, Refused
from multidrop.dialects.family import Progress
from multidrop.dialects.files import SourceLine
from multidrop.dialects.held import Held
from multidrop.dialects.mcode.host.exchange import REPEATS
from multidrop.dialects.mcode.host.listing import declared, programs_of, stored
from multidrop.dialects.mcode.host.operations import flag, immediate, listing, perform
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import who

T = TypeVar("T")


def read(state: MCodeState, _: Sequence[SourceLine], progress: Progress) -> Procedure[Held]:
    """Read the program as listed, and labels and variables; no lines from a drive that is locked."""
    progress(0, 1)
    locked = yield from _again(state, lambda: flag(state, "LK"))
    listed = () if locked else (yield from _again(state, lambda: listing(state, "")))
    names = yield from _again(state, lambda: perform(state, "PR UV"))
    return Held(stored(listed), tuple(name.strip() for name in names if name.strip()), locked)


def _again(state: MCodeState, ask: Callable[[], Procedure[T]]) -> Procedure[T]:
    """Ask again after a damaged reply: these questions change nothing. A drive that is silent is not asked again."""
    for _ in range(REPEATS):
        try:
            return (yield from ask())
        except NoAnswer:
            if state.settings_unknown or state.programming:
                raise
    return (yield from ask())


def start(lines: Sequence[SourceLine], label: str) -> str:
    """Return the line that executes a program of a file. Raises Diagnostic where the file has no such label."""
    found = programs_of(lines)
    inside = [declared(line.text) for program in found for line in program.lines]
    labels = [name for word, name in filter(None, inside) if word == "LB"]
    if label.upper() not in (*labels, *(program.place for program in found)):
        hint = f"labels: {', '.join(labels)}" if labels else "the file has no labels"
        raise Diagnostic(f"no label {label} in the file", "", hint)
    return f"EX {label.upper()}"


def end(state: MCodeState) -> Procedure[bool]:
    """End the running program with E, and the motion that it has begun with SL 0; return whether one ran.

    Both take a while. Raises Refused where the motor moves without a program.
    """
    if not (yield from _again(state, lambda: flag(state, "BY"))):
        if (yield from _again(state, lambda: flag(state, "MV"))):
            raise Refused(f"{who(state)} moves: stop it first (nothing was sent)")
        return False
    yield from immediate(state, state.codec.request(state.address, "E"))
    if (yield from _again(state, lambda: flag(state, "MV"))):
        yield from immediate(state, state.codec.request(state.address, "SL 0"))
    return True
