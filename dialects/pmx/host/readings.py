"""Values of PMX controllers for plots."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.errors import Diagnostic, Refused
from multidrop.dialects.pmx.host.exchange import answered, who
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.manual.table import lookup
from multidrop.dialects.readings import Readings, number


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
        return number(who(state), word, reply.text)
    except ValueError as wrong:
        raise Refused(str(wrong)) from None


READINGS = Readings(check=check, first=lambda state, word: again(state, word, Priority.OPERATOR), again=again)
