"""What is read of an MCode drive for a person: settings, conditions, values for plots, and all of it for a snapshot."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from multidrop.base.errors import Diagnostic, NoAnswer, Refused
from multidrop.dialects.by_hand import ByHand
from multidrop.dialects.codec import End, Priority, Procedure
from multidrop.dialects.program_files import LOCKED
from multidrop.dialects.state import who
from multidrop.dialects.values import (
    Conditions,
    Facts,
    Parameters,
    Part,
    Progress,
    Readings,
    Snapshot,
    Value,
    printed_number,
)
from multidrop.families.lexium.host.mcode.before_request import before_request, value_of
from multidrop.families.lexium.host.mcode.codec import EVERY_DRIVE
from multidrop.families.lexium.host.mcode.debugging import MCodeDebugging
from multidrop.families.lexium.host.mcode.exchange import (
    check_printed,
    note_error,
    question,
    send_once,
    value,
)
from multidrop.families.lexium.host.mcode.settings import (
    VALUE_SEPARATOR,
    MCodeParameters,
    items_and_forms,
    list_request,
    listed,
)
from multidrop.families.lexium.host.mcode.state import MCodeState, refuse_in_program
from multidrop.families.lexium.host.motions import POINTS, cause
from multidrop.families.lexium.host.values import SNAPSHOT_WORDS, LexiumValues, number_in, rows_of_list
from multidrop.families.lexium.manual import parameters as manual
from multidrop.families.lexium.manual import points
from multidrop.families.lexium.manual.mnemonic import EVERY, LEXIUM, MDRIVE_PLUS
from multidrop.families.lexium.manual.parameters import SettingForm, form_of
from multidrop.families.lexium.manual.statements import UNNAMED
from multidrop.families.lexium.manual.table import lookup, words

# Conditions: one print for the state; settings and set-ups once, and after each line.
#
# Theory of operation. The state is one signed PR of flags and values. ER is never read, since that clears it. Nothing
# is asked with EM=3, whose prints wait in a queue. A set-up prints a list, whose last line ends it. The target is
# known where the host sent the move: MA, or MR from a position that was read at rest.


STATE = ("EF", "BY", "MV", "VC", "MP", "DE", "ST", "P", "IN", "I5", "AF")
"""What changes by itself, or by a program; the flags first, which need no separator."""
SETTLED = "IS1"
"""Among the facts once the set-ups were read."""
REFUSAL = "refuses to print its conditions"
NUMBER = r"-?\d{1,10}(?:\.\d+)?"
"""What a value for a plot prints: one signed print each, and never a word whose reading clears it."""
BAUDS = {48: 4800, 96: 9600, 19: 19200, 38: 38400, 11: 115200}
"""By BD (5.1.9)."""
_LISTED = re.compile(r"(\d+)\s+(\S.*)")


class MCodeValues(LexiumValues):
    """What is read of an MCode drive."""

    state: MCodeState

    @property
    def parameters(self) -> Parameters:
        return MCodeParameters(self.state)

    @property
    def by_hand(self) -> ByHand:
        from multidrop.families.lexium.host.mcode.by_hand import MCodeByHand

        return MCodeByHand(self.state)

    def snapshot(self, progress: Progress) -> Procedure[Snapshot]:
        """Read a drive. Raises Refused where it would store the questions, or NoAnswer."""
        state = self.state
        readings = yield from MCodeParameters(state).read(progress)
        known, whole = words(state.product), state.product in EVERY
        asked = [
            word for word in SNAPSHOT_WORDS if word in known and (state.product in known[word].products or not whole)
        ]
        items, pattern = '," ",'.join(asked), " ".join(r"-?\d{1,10}" for _ in asked)
        now = dict(zip(asked, map(int, (yield from value_of(state, items, pattern)).split()), strict=True))
        program, remarks = yield from self._program(readings, running=bool(now["BY"]))
        snapshot = self.snapshot_of(readings, now)
        return replace(
            snapshot,
            name=state.name or UNNAMED,
            party=state.codec.party,
            baud=BAUDS.get(number_in(readings, "BD"), 0),
            program=program,
            remarks=(*remarks, *snapshot.remarks),
        )

    def parts(self, facts: Facts) -> Sequence[Part]:
        """The parts of a drive: its state, its settings, and its set-ups, which have another form on an MDrivePlus."""
        state = self.state
        if state.codec.em == 3 or state.address in EVERY_DRIVE or state.programming:
            return ()
        parts = [
            Part("state", partial(self._state, before=facts)),
            Part("settings", partial(self._values, names=points.SETTINGS), slow=True),
        ]
        if facts.get("BY") and SETTLED in facts:
            return parts  # a list has no signature, and a program prints lines, too
        if not (lists := manual.lists(state.product, state.version)):
            return [*parts, Part("points", partial(self._values, names=POINTS), slow=True)]
        return parts + [
            Part(word, partial(self._list, word=word, numbers=rows), slow=True) for word, rows in lists.items()
        ]

    def fold(self, facts: Facts) -> tuple[Conditions, ...]:
        state = self.state
        modes = f"EM{state.codec.em} CK{state.codec.checksum}"
        return (replace(points.conditions(state.product, facts, state.heading), modes=modes),)

    def check(self, word: str) -> str:
        """Check the form of a word, and that its reading clears nothing."""
        try:
            MCodeDebugging(self.state).names([word])
        except Diagnostic as wrong:
            raise Diagnostic(wrong.message.replace("be watched", "be polled"), wrong.where, wrong.hint) from None
        return word.upper()

    def first(self, word: str) -> Procedure[float]:
        """Read a value; a name with VA is looked up first, since asking for one that is not there is an error."""
        state = self.state
        refuse_in_program(state)
        values = yield from MCodeDebugging(state).values([word])
        if word not in values:
            raise Refused(f"{who(state)} has no variable {word}")
        return printed_number(who(state), word, values[word])

    def again(self, word: str, priority: Priority) -> Procedure[float]:
        """Read a value. The error flag is noted and not cleared."""
        state = self.state
        refuse_in_program(state)
        yield from before_request(state, replace(question(state, word, NUMBER), priority=priority))
        reply = yield replace(question(state, word, NUMBER), priority=priority)
        if reply.end is End.REFUSED:
            note_error(state, reply)
            raise Refused(f"{who(state)} refused 'PR {word}'")
        check_printed(state, reply)
        return float(value(state, reply))

    def own(self, word: str) -> bool:
        return lookup(word.upper(), self.state.product) is not None

    def _state(self, before: Facts) -> Procedure[Facts]:
        state = self.state
        facts = dict((yield from self._values(STATE)))
        facts[points.CAUSE] = cause(state.product, facts, before)
        state.program_read(error=bool(facts["EF"]), running=bool(facts["BY"]))
        position = facts["P"]
        at_rest = isinstance(position, int) and not facts["MV"] and not facts["BY"]
        state.seen_at_rest(position if at_rest and isinstance(position, int) else None)
        return facts

    def _values(self, names: Sequence[str]) -> Procedure[Facts]:
        """Print values in one line. Raises Refused or NoAnswer, and reads no error.

        Asks the words that the product has; of an unknown product, those that every Lexium has.
        """
        state = self.state
        table, known = words(state.product), state.product in EVERY
        batch = [table[name] for name in names if name in table]
        batch = [
            row for row in batch if (state.product in row.products if known else row.products in (LEXIUM, MDRIVE_PLUS))
        ]
        items, forms = items_and_forms(batch)
        answer = "".join(f"(?:{form})" for form in forms)
        yield from before_request(state, replace(question(state, items, answer), priority=Priority.POLL))
        reply = yield from send_once(state, replace(question(state, items, answer), priority=Priority.POLL))
        check_printed(state, reply, REFUSAL)
        match = re.fullmatch("".join(f"({form})" for form in forms), value(state, reply))
        assert match is not None
        facts: dict[str, Value] = {}
        for row, text in zip(batch, match.groups(), strict=True):
            fields = tuple(int(number) for number in text.removeprefix(VALUE_SEPARATOR).split(","))
            facts[row.name] = fields if form_of(row) is SettingForm.FIELDS else fields[0]
        return facts

    def _list(self, word: str, numbers: Sequence[int]) -> Procedure[Facts]:
        state = self.state
        yield from before_request(state, replace(question(state, "EF", "[01]"), priority=Priority.POLL))
        reply = yield from send_once(state, replace(list_request(state, word, numbers), priority=Priority.POLL))
        check_printed(state, reply, REFUSAL)
        rows = rows_of_list(word, numbers, reply.lines)
        if reply.doubtful or len(rows) < len(numbers):
            state.reply_lost()
            raise NoAnswer(f"{who(state)}: the list of {word} may be incomplete, or another drive's")
        return rows

    def _program(self, readings: Readings, running: bool) -> Procedure[tuple[tuple[tuple[int, str], ...], list[str]]]:
        """Read the listing; one that a running program's prints may have come into is read twice.

        A locked program is not asked for, as the refusal would run a resident OE subroutine (5.1.75).
        """
        if number_in(readings, "LK"):
            return (), [f"not read: {LOCKED}"]
        first = yield from listed(self.state, "L")
        if running and first != (yield from listed(self.state, "L")):
            return (), ["its program was not read: it runs, and its prints came between the lines"]
        rows = [_LISTED.fullmatch(line.strip()) for line in first]
        lost = [line for line, row in zip(first, rows, strict=True) if row is None]
        doubts = [f"its listing has a line that is not a program line: {line!r}" for line in lost]
        return tuple((int(row[1]), row[2]) for row in rows if row is not None), doubts
