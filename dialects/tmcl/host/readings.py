"""Axis parameters of TMCL modules for plots: `AP206` is parameter 206 of motor 0, `AP206/1` that of motor 1."""

from __future__ import annotations

import re

from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.readings import Readings
from multidrop.dialects.tmcl.host.exchange import read
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual.commands import Call, Command

_WORD = re.compile(r"AP(\d{1,3})(?:/(\d))?", re.IGNORECASE | re.ASCII)


def check(state: TmclState, word: str) -> str:
    """Check that a word names an axis parameter."""
    found = _WORD.fullmatch(word)
    if found is None or int(found[1]) > 255:
        raise Diagnostic(
            f"{word} cannot be plotted", hint="valid: AP and a parameter, /MOTOR after it; as AP206, AP1/1"
        )
    return word.upper()


def again(state: TmclState, word: str, priority: Priority) -> Procedure[float]:
    """Read a parameter. The manual has none whose reading changes the module."""
    found = _WORD.fullmatch(word)
    assert found is not None
    return float((yield from read(state, Call(Command.GAP, int(found[1]), int(found[2] or 0)), priority)))


READINGS = Readings(check=check, first=lambda state, word: again(state, word, Priority.OPERATOR), again=again)
