"""The conditions of an MCode drive: one print for its state; settings and set-ups once, and after each line.

Theory of operation. The state is one signed PR of flags and values. ER is never read, since that clears it. Nothing is
asked with EM=3, whose prints wait in a queue. A set-up prints a list, whose last line ends it. The target is known
where the host sent the move: MA, or MR from a position that was read at rest.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.conditions import Conditions, Facts, Part, Reader
from multidrop.dialects.errors import NoAnswer, Refused
from multidrop.dialects.mcode.host.attend import attend
from multidrop.dialects.mcode.host.exchange import note_error
from multidrop.dialects.mcode.host.parameters import BETWEEN, GLOBAL, asked, rows_of_list
from multidrop.dialects.mcode.host.signatures import question, value
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import who
from multidrop.dialects.mcode.manual import parameters as manual
from multidrop.dialects.mcode.manual import points
from multidrop.dialects.mcode.manual.parameters import Form, Setting
from multidrop.dialects.mcode.manual.table import words

STATE = ("EF", "BY", "MV", "VC", "MP", "DE", "P", "IN", "I5", "AF")
"""What changes by itself, or by a program; the flags first, which need no separator."""
SETTINGS = ("EE", "AS", "RC", "HC", "VI", "VM", "A", "D")
POINTS = ("S1", "S2", "S3", "S4")
"""The set-ups of an MDrivePlus."""
SETTLED = "IS1"
"""Among the facts once the set-ups were read."""
UNSURE = frozenset({"EE", "AS", "AF", "I5"})
"""Words that not every Lexium has."""


def parts(state: MCodeState, facts: Facts) -> Sequence[Part[MCodeState]]:
    """The parts of a drive: its state, its settings, and its set-ups, which have another form on an MDrivePlus."""
    if state.codec.em == 3 or state.address in GLOBAL or state.programming:
        return ()
    found = [Part("state", _state), Part("settings", partial(_values, names=SETTINGS), slow=True)]
    if facts.get("BY") and SETTLED in facts:
        return found  # a list has no signature, and a program prints lines, too
    if not (lists := manual.lists(state.product, state.version)):
        return [*found, Part("points", partial(_values, names=POINTS), slow=True)]
    return found + [Part(word, partial(_list, word=word, numbers=rows), slow=True) for word, rows in lists.items()]


def _state(state: MCodeState) -> Procedure[Facts]:
    facts = yield from _values(state, STATE)
    state.program_read(error=bool(facts["EF"]), running=bool(facts["BY"]))
    position = facts["P"]
    at_rest = isinstance(position, int) and not facts["MV"] and not facts["BY"]
    state.seen_at_rest(position if at_rest and isinstance(position, int) else None)
    return facts


def _has(state: MCodeState, names: Sequence[str]) -> list[str]:
    """The words that the product has; of an unknown product, those that every Lexium has."""
    table = words(state.product)
    known = manual.exact(state.product)
    return [name for name in names if (state.product in table[name].products if known else name not in UNSURE)]


def _values(state: MCodeState, names: Sequence[str]) -> Procedure[Facts]:
    """Print values in one line. Raises Refused or NoAnswer, and reads no error."""
    table = words(state.product)
    batch = [
        Setting(table[name], manual.form_of(table[name])) for name in _has(state, [n for n in names if n in table])
    ]
    items, forms = asked(batch)
    answer = "".join(f"(?:{form})" for form in forms)
    yield from _attended(state, question(state, items, answer))
    reply = yield replace(question(state, items, answer), priority=Priority.POLL)
    _check(state, reply)
    found = re.fullmatch("".join(f"({form})" for form in forms), value(state, reply))
    assert found is not None
    texts = [each.removeprefix(BETWEEN) for each in found.groups()]
    return {each.name: _value(each, text) for each, text in zip(batch, texts, strict=True)}


def _value(setting: Setting, text: str) -> int | tuple[int, ...]:
    if setting.form is Form.FIELDS:
        return tuple(int(each) for each in text.split(","))
    return int(text)


def _list(state: MCodeState, word: str, numbers: Sequence[int]) -> Procedure[Facts]:
    """Print set-ups, up to the last number."""
    yield from _attended(state, question(state, "EF", "[01]"))
    last = rf" *{word} *= *{numbers[-1]} *(?:, *-?\d+ *)+"
    row = rf" *{word} *=.*"
    wanted = replace(
        state.codec.request(state.address, f"PR {word}"), kind=Kind.PRINT, expect=last, gather=True, rows=row
    )
    reply = yield replace(wanted, priority=Priority.POLL)
    _check(state, reply)
    rows = rows_of_list(word, numbers, reply.lines)
    if reply.doubtful or len(rows) < len(numbers):
        state.reply_lost()
        raise NoAnswer(f"{who(state)}: the list of {word} may be incomplete, or another drive's")
    return rows


def _attended(state: MCodeState, wanted: Request) -> Procedure[None]:
    """Clear what earlier requests left, at the priority of polls."""
    yield from attend(state, replace(wanted, priority=Priority.POLL))


def _check(state: MCodeState, reply: Reply) -> None:
    """Raise Refused or NoAnswer unless the drive printed."""
    note_error(state, reply)
    if reply.end is End.REFUSED and not reply.doubtful:
        raise Refused(f"{who(state)} refuses to print its conditions")
    if reply.end is not End.DONE:
        if reply.end is not End.NAK:
            state.reply_lost()
        raise NoAnswer(f"{who(state)} does not reply ({reply.end.value})")


def fold(state: MCodeState, facts: Facts) -> tuple[Conditions, ...]:
    """The conditions of its only axis."""
    modes = f"EM{state.codec.em} CK{state.codec.checksum}"
    return (replace(points.conditions(state.product, facts, state.heading), modes=modes),)


READER = Reader(parts=parts, fold=fold)
