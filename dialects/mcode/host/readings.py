"""Values of MCode drives for plots: one signed print each, and never a word whose reading clears it."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import End, Priority, Procedure
from multidrop.dialects.errors import Diagnostic, NoAnswer, Refused
from multidrop.dialects.mcode.host.attend import attend
from multidrop.dialects.mcode.host.debugging import check_names, values
from multidrop.dialects.mcode.host.exchange import note_error
from multidrop.dialects.mcode.host.signatures import question, value
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import who
from multidrop.dialects.mcode.manual.table import lookup
from multidrop.dialects.readings import Readings, number

NUMBER = r"-?\d{1,10}(?:\.\d+)?"


def check(state: MCodeState, word: str) -> str:
    """Check the form of a word, and that its reading clears nothing."""
    try:
        check_names(state, [word])
    except Diagnostic as wrong:
        raise Diagnostic(wrong.message.replace("be watched", "be plotted"), wrong.where, wrong.hint) from None
    return word.upper()


def first(state: MCodeState, word: str) -> Procedure[float]:
    """Read a value; a name with VA is looked up first, since asking for one that is not there is an error."""
    _not_in_program(state)
    found = yield from values(state, [word])
    if word not in found:
        raise Refused(f"{who(state)} has no variable {word}")
    try:
        return number(who(state), word, found[word])
    except ValueError as wrong:
        raise Refused(str(wrong)) from None


def again(state: MCodeState, word: str, priority: Priority) -> Procedure[float]:
    """Read a value. The error flag is noted and not cleared."""
    _not_in_program(state)
    yield from attend(state, replace(question(state, word, NUMBER), priority=priority))
    reply = yield replace(question(state, word, NUMBER), priority=priority)
    note_error(state, reply)
    if reply.end is End.REFUSED:
        raise Refused(f"{who(state)} refused 'PR {word}'")
    if reply.end is not End.DONE:
        if reply.end is not End.NAK:
            state.reply_lost()
        raise NoAnswer(f"{who(state)} does not reply ({reply.end.value})")
    return float(value(state, reply))


def _not_in_program(state: MCodeState) -> None:
    if state.programming:
        raise Refused(f"{who(state)} is in program mode and would store it: PG ends that")


def own(state: MCodeState, word: str) -> bool:
    """Whether a word is a mnemonic, and no name with VA."""
    return lookup(word.upper(), state.product) is not None


READINGS = Readings(check=check, first=first, again=again, own=own)
