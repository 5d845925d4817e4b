"""What is read of an Ethernet drive over Modbus: settings, conditions, values for plots, and all of it for a snapshot.

The drive and its rules are those of MCode, so the order of the steps is, too. What has no register, or another form in
it, is left to MCode/TCP. Nothing moves, and nothing is cleared. What a step is in units is read in the same way.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from multidrop.base.errors import Diagnostic, Inexpressible, NoAnswer, Refused
from multidrop.dialects.by_hand import ByHand
from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.state import who
from multidrop.dialects.values import (
    Conditions,
    Facts,
    Parameters,
    Part,
    Permission,
    Plan,
    Progress,
    Readings,
    Snapshot,
    Value,
    number,
    printed_number,
    same,
)
from multidrop.families.lexium.host.modbus import framing, mapping
from multidrop.families.lexium.host.modbus.codec import ModbusState, pdu_codec
from multidrop.families.lexium.host.modbus.identity import identification
from multidrop.families.lexium.host.modbus.operations import (
    OUTPUTS,
    ModbusOperations,
    printed,
    request,
    sure,
    value,
)
from multidrop.families.lexium.host.motions import cause
from multidrop.families.lexium.host.parameters import LexiumParameters
from multidrop.families.lexium.host.values import SNAPSHOT_WORDS, LexiumValues, rows_of_list
from multidrop.families.lexium.manual import parameters as manual
from multidrop.families.lexium.manual import points
from multidrop.families.lexium.manual.groups import LISTS
from multidrop.families.lexium.manual.mnemonic import EVERY
from multidrop.families.lexium.manual.modbus.registers import IDENTITY, REGISTERS, SETUPS
from multidrop.families.lexium.manual.parameters import reading_of
from multidrop.families.lexium.manual.table import words

NO_REGISTER = "no Modbus register; MCode/TCP (tcp://HOST:503) reads it"
DECLARED = tuple((f"V{n}", "reading it is an error unless a program declares it") for n in range(1, 9))


def _why_not(name: str, value: Value) -> str:
    """The reason for which a register does not take a value; empty: it does."""
    if re.fullmatch(r"[IO]S\d", name):
        return ""
    row = REGISTERS.get(name)
    if row is None or "values" in row.differs:
        return NO_REGISTER.replace("reads", "writes")
    if isinstance(value, (int, float)) and not row.allows(int(number(value))):
        return f"its register takes {row.limits}; MCode/TCP (tcp://HOST:503) may take it"
    return ""


class ModbusParameters(LexiumParameters):
    """The settings of an Ethernet drive."""

    state: ModbusState

    def read(self, progress: Progress) -> Procedure[Readings]:
        """Read every setting that a register has. Raises NoAnswer; nothing is changed or cleared."""
        state = self.state
        settings = [setting.name for setting in manual.settings(state.product, state.version, state.part)]
        names = [name for name in settings if name in REGISTERS and "values" not in REGISTERS[name].differs]
        lists = {word: rows for word, rows in manual.lists(state.product, state.version).items() if word != "LS"}
        values: dict[str, Value] = {}
        unread = [*manual.unread(state.product), *DECLARED]
        unread += [(name, NO_REGISTER) for name in settings if name not in names]
        for done, name in enumerate(names):
            progress(done, len(names) + len(lists))
            try:
                text = yield from printed(state, name)
                if not re.fullmatch(r"-?\d+", text):
                    raise NoAnswer(f"{who(state)}: the reply to 'PR {name}' is damaged")
                values[name] = int(text)
            except Refused as refusal:
                unread.append((name, str(refusal)))
        for done, (word, numbers) in enumerate(lists.items(), len(names)):
            progress(done, len(names) + len(lists))
            values |= _rows(word, numbers, (yield from printed(state, word)))
        progress(1, 1)
        counts, table = manual.counting(values), words(state.product)
        rows = [reading_of(name, value, table.get(name), counts) for name, value in values.items()]
        return Readings(tuple(rows), tuple(unread))

    def plan(self, present: Readings, wanted: Mapping[str, Value], permission: Permission) -> Plan:
        """Order the steps to the wanted values; a value that its register does not take is left alone."""
        given = {name.upper(): value for name, value in wanted.items()}
        changed = {name: value for name, value in given.items() if not same(value, present.values.get(name))}
        outside = {name: _why_not(name, value) for name, value in changed.items()}
        aside = {name: reason for name, reason in outside.items() if reason}
        inside = {name: value for name, value in given.items() if name not in aside}
        made = super().plan(present, inside, permission)
        return Plan(made.changes, made.withheld, (*made.impossible, *aside.items()), made.remarks)

    def ready(self) -> Procedure[str]:
        """Return the reason for which settings must not change now; empty: there is none."""
        state = self.state
        if (yield from ModbusOperations(state).flag("MV")):
            return f"{who(state)} moves: stop it first"
        if (yield from ModbusOperations(state).flag("BY")):
            return f"{who(state)} runs a program: E ends it"
        armed = yield from value(state, "TE")
        return f"{who(state)} has armed trips (TE={armed}): TE=0 disarms them" if armed else ""

    def save(self) -> Procedure[object]:
        return ModbusOperations(self.state).perform("S")


FLAGS = ("EF", "BY", "MV", "DE")
SIGNS = ("ST", "AF")
"""What shows the cause of an error, on drives that have it."""
INPUTS = 4


def _rows(word: str, numbers: Sequence[int], text: str) -> Mapping[str, Value]:
    return rows_of_list(word, numbers, text.replace("\r", "").split("\n"))


_NO_NUMBER = IDENTITY.keys() | SETUPS


SERIAL = 5
"""The object of the identification."""
DIVIDED = 4
"""Counts of the analog input in one count of its register."""
NO_PROGRAM = ("its program and variables", "Modbus reads neither; MCode/TCP (tcp://HOST:503) does")


class ModbusValues(LexiumValues):
    """What is read of an Ethernet drive."""

    state: ModbusState

    @property
    def parameters(self) -> Parameters:
        return ModbusParameters(self.state)

    @property
    def by_hand(self) -> ByHand:
        from multidrop.families.lexium.host.modbus.by_hand import ModbusByHand

        return ModbusByHand(self.state)

    def snapshot(self, progress: Progress) -> Procedure[Snapshot]:
        state = self.state
        readings = yield from ModbusParameters(state).read(progress)
        if not state.serial:
            state.serial_read((yield from identification(state)).get(SERIAL, ""))
        known, now = words(state.product), {}
        for word in SNAPSHOT_WORDS:
            if word in known and state.product in known[word].products:
                now[word] = int((yield from printed(state, word)))
        if "I5" in now:
            now["I5"] *= DIVIDED
        return self.snapshot_of(replace(readings, unread=(*readings.unread, NO_PROGRAM)), now)

    def parts(self, facts: Facts) -> Sequence[Part]:
        state = self.state
        table = words(state.product)
        signs = [n for n in SIGNS if state.product in EVERY and state.product in table[n].products]
        parts = [Part("state", partial(self._state, names=(*FLAGS, *signs), before=facts))]
        has = [n for n in points.SETTINGS if state.product not in EVERY or state.product in table[n].products]
        parts += [Part(name, partial(self._registers, names=(name,)), slow=True) for name in has]
        lists = manual.lists(state.product, state.version)
        parts += [Part(word, partial(self._setups, word=word), slow=True) for word in ("IS", "OS") if word in lists]
        return parts

    def fold(self, facts: Facts) -> tuple[Conditions, ...]:
        return (points.conditions(self.state.product, facts, None),)

    def check(self, word: str) -> str:
        """Check that a word has a register or an input to read, and that its reading clears nothing."""
        name = word.upper()
        try:
            mapping.reading(name)
        except (Inexpressible, Refused) as reason:
            raise Diagnostic(f"{word} cannot be polled: {reason}") from None
        if name == "ER" or name in _NO_NUMBER:
            why = "reading it clears it" if name == "ER" else "it is not a number"
            raise Diagnostic(f"{word} cannot be polled: {why}")
        return name

    def again(self, word: str, priority: Priority) -> Procedure[float]:
        return printed_number(who(self.state), word, (yield from printed(self.state, word, priority)))

    def _registers(self, names: Sequence[str]) -> Procedure[Facts]:
        values = {}
        for name in names:
            values[name] = yield from value(self.state, name, Priority.POLL)
        if "EF" in values:
            self.state.error_flag_read(bool(values["EF"]))
        return values

    def _points(self) -> Procedure[Facts]:
        """Read all inputs, then all outputs; an input's bit is 1 while it is active."""
        points: dict[str, int] = {}
        for letter, function, count in (("I", framing.READ_INPUTS, INPUTS), ("O", framing.READ_COILS, OUTPUTS)):
            asked = request(
                self.state, f"{letter}1 to {letter}{count}", pdu_codec().read(function, 0, count), Priority.POLL
            )
            bits = pdu_codec().bits(sure(self.state, asked, (yield asked)), count)
            points |= {f"{letter}{n}": bit for n, bit in enumerate(bits, 1)}
        return points

    def _state(self, names: Sequence[str], before: Facts) -> Procedure[Facts]:
        state = self.state
        facts = {**(yield from self._registers(names)), **(yield from self._points())}
        facts[points.CAUSE] = cause(state.product, facts, before)
        return facts

    def _setups(self, word: str) -> Procedure[Facts]:
        return _rows(word, LISTS[word], (yield from printed(self.state, word, Priority.POLL)))
