"""Proof of a command that shows no sign of its execution: its effect is read where reading is harmless.

Theory of operation. In EM=2, and with CK=2 while a program runs, a drive does not show that it executed a command.
EF=0 only shows that it refused none. An ACK or a line end may also be another drive's, late. So the host reads a
setting back. A drive that was at rest and moves now, or runs a program now, has executed the command that starts it.
Everything else is reported as not confirmed. (MCode reference 5.1.21, 5.1.39; decision 0010.)
"""

from __future__ import annotations

from typing import NamedTuple

from multidrop.dialects.codec import Kind, Procedure, Request
from multidrop.dialects.errors import NoAnswer, Refused
from multidrop.dialects.mcode.host.exchange import answered
from multidrop.dialects.mcode.host.printed import INTEGER
from multidrop.dialects.mcode.host.signatures import question, value
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import who
from multidrop.dialects.mcode.manual.grammar import LineError, Number, Unary, parse
from multidrop.dialects.mcode.manual.table import lookup

READ_BACK = {
    *("A", "D", "DB", "DE", "DT", "EE", "HC", "HT", "JE", "LK", "LM", "MS", "MT", "NE"),
    *("PM", "R1", "R2", "R3", "R4", "RC", "SF", "SM", "VI", "VM", "WT"),
}
"""Words that print the number that was written, until something writes another one."""
ROUNDED = {"A": 100, "D": 100}
"""Greatest difference between the number written and the number read, where a drive rounds."""


class Rest(NamedTuple):
    """The activity of a drive: whether a program runs, whether it moves, its position."""

    busy: bool
    moving: bool
    position: int

    @property
    def resting(self) -> bool:
        """Whether nothing that happens next happens by itself."""
        return not self.busy and not self.moving


def rest_before(state: MCodeState, request: Request) -> Procedure[Rest | None]:
    """Read what the drive does before a command that can start motion, where only that can confirm it."""
    silent = state.codec.em == 2 and request.kind is Kind.COMMAND
    if not silent or written(request.text) is not None or not state.codec.starts_motion(request.text):
        return None
    before = yield from _rest(state)
    if before is None:
        raise NoAnswer(f"{who(state)} does not reply: '{request.text}' was not sent")
    return before


def confirm_effect(state: MCodeState, request: Request, before: Rest | None) -> Procedure[None]:
    """Read the effect of a command that no sign of the drive confirms; note where that proves nothing.

    Raises NoAnswer if the setting that it wrote reads as another number.
    """
    if (setting := written(request.text)) is not None:
        yield from _read_back(state, request, *setting)
    elif before is None or not before.resting:
        _not_confirmed(state, request)
    else:
        after = yield from _rest(state)
        if after is None or (after.resting and after.position == before.position):
            _not_confirmed(state, request)


def written(text: str) -> tuple[str, int] | None:
    """Find the word that a line sets to a whole number, where the drive prints that number back; else None."""
    try:
        statement = parse(text)
    except LineError:
        return None
    if statement is None or len(statement.arguments) != 1:
        return None
    [argument] = statement.arguments
    sign = 1
    if isinstance(argument, Unary) and argument.op == "-":
        sign, argument = -1, argument.operand
    row = lookup(statement.word)
    if row is None or row.name not in READ_BACK or not isinstance(argument, Number) or argument.value % 1:
        return None
    return row.name, sign * int(argument.value)


def _read_back(state: MCodeState, request: Request, word: str, number: int) -> Procedure[None]:
    """Read a setting. A running program may have written another number meanwhile."""
    found = yield from _numbers(state, f'{word}," ",BY', f"{INTEGER} [01]")
    if found and abs(found[0] - number) <= ROUNDED.get(word, 0):
        return
    if not found or found[1]:
        return _not_confirmed(state, request)
    fate = "it is not known whether it was executed; it was sent once"
    raise NoAnswer(f"{who(state)}: {word} reads {found[0]} after '{request.text}': {fate}")


def _rest(state: MCodeState) -> Procedure[Rest | None]:
    found = yield from _numbers(state, 'BY," ",MV," ",P', f"[01] [01] {INTEGER}")
    return Rest(found[0] == 1, found[1] == 1, found[2]) if found else None


def _numbers(state: MCodeState, items: str, form: str) -> Procedure[list[int]]:
    """Read numbers; none where the drive does not print them."""
    try:
        reply = yield from answered(state, question(state, items, form))
    except (NoAnswer, Refused):
        return []
    if not reply.lines:
        state.reply_lost()
        return []
    return [int(each) for each in value(state, reply).split()]


def _not_confirmed(state: MCodeState, request: Request) -> None:
    state.note(f"{who(state)}: '{request.text}' was sent once and not refused; its execution is not confirmed")
