"""What each variable and flag of a simulated drive reads and writes.

A plain one is a number in memory with the range that the table of mnemonics gives it. The others have a reader or a
writer: those of motion in `motion_variables`, of inputs, outputs and trips in `io_variables`. Compiled lines get
closures from `reader` and `writer`, which raise Fault: 20 unknown, 21 wrong value, 25 read only, 30 not there, 32 a
label, 35 cannot be read, 37 not in this drive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Argument, Compare, Text
from multidrop.dialects.mcode.manual.table import Mnemonic
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import PI, Read, Value, compile_value, compile_whole, whole
from multidrop.simulator.lexium.state.memory import Memory, slot
from multidrop.simulator.lexium.state.program_memory import Program
from multidrop.simulator.lexium.state.ranges import Ranges, within
from multidrop.simulator.lexium.state.timeline import Timeline

Write = Callable[[Value], None]
Readers = Mapping[str, Read]
Writers = Mapping[str, Write]

WATCHED = ("HC", "LD", "LG", "LT", "RC", "SM", "TD", "TQ", "WT", "CM")
"""Plain variables on which it depends what happens next."""


def _unreadable() -> Value:
    raise Fault(E.NOT_PRINTABLE)


class VariableAccess:
    """The variables of one drive. `saved_lock` gives whether NVM holds a lock."""

    def __init__(
        self,
        memory: Memory,
        program: Program,
        timeline: Timeline,
        running: Callable[[], bool],
        saved_lock: Callable[[], bool],
        readers: Readers,
        writers: Writers,
    ) -> None:
        self._memory, self._program, self._timeline, self._saved_lock = memory, program, timeline, saved_lock
        self._ranges = Ranges(memory)
        self.row = self._ranges.row
        self._readers: Readers = {
            "LS": _unreadable,
            "PI": lambda: PI,
            "BY": lambda: int(running()),
            **readers,
        }
        self._writers: Writers = {
            "BD": self._write_baud,
            "ER": self._write_error,
            "IF": self._write_input_flag,
            "LK": self._write_lock,
            **{name: partial(self._write_watched, name) for name in WATCHED},
            **writers,
        }

    def reader(self, word: str) -> Read:
        """A closure that gives a variable's value."""
        row = self.row(word)
        if row is not None and word in self._readers:
            return self._readers[word]
        values, key = self._memory.values, word if row else slot(word)
        if row is not None and row.kind == "reserved":
            raise Fault(E.ILLEGAL_DATA)
        if row is not None and (word not in values or row.access == "WO"):
            raise Fault(E.NOT_PRINTABLE)

        def read() -> Value:
            try:
                return values[key]
            except KeyError:
                raise Fault(E.NO_SUCH_NAME) from None

        return read

    def writer(self, word: str) -> Write:
        """A closure that gives a variable a value, or raises Fault."""
        row = self.row(word)
        if row is None:
            return self._user_writer(word)
        if word in self._writers:
            return self._writers[word]
        if row.access in ("RO", "RC") or row.kind in ("keyword", "math"):
            raise Fault(E.READ_ONLY)
        if word not in self._memory.values:
            raise Fault(E.UNKNOWN_VARIABLE)
        if row.low_encoder is not None or row.values:
            return partial(self._ranges.write, row)
        return self._plain_writer(row)

    def value(self, argument: Argument | None, floating: bool = False) -> Read:
        """A closure that gives an argument's value. Raises Fault (21, 24) for what has none."""
        if isinstance(argument, Text):
            raise Fault(E.OUT_OF_RANGE)
        if argument is None or isinstance(argument, Compare):
            raise Fault(E.ILLEGAL_DATA)
        if not self._memory.model.floating:
            return compile_whole(argument, self.reader)
        return compile_value(argument, self.reader, floating)

    def declared(self, word: str) -> bool:
        """Whether a user variable is there, or will be once the program has run its VA line."""
        return word in self._memory.scopes or word in self._program.declared

    def _user_writer(self, word: str) -> Write:
        values, key = self._memory.values, slot(word)
        if word in self._program.labels:
            raise Fault(E.LABEL_NOT_SETTABLE)
        if not self.declared(word):
            raise Fault(E.UNKNOWN_VARIABLE)

        def write(value: Value) -> None:
            if key not in values:
                raise Fault(E.UNKNOWN_VARIABLE)
            values[key] = within(whole(value), -0x80000000, 0x7FFFFFFF)

        return write

    def _plain_writer(self, row: Mnemonic) -> Write:
        values, name = self._memory.values, row.name
        low, high = row.low or 0, row.high or 0
        if isinstance(row.default, float):

            def write_float(value: Value) -> None:
                values[name] = float(within(value, low, high))

            return write_float

        def write(value: Value) -> None:
            if not isinstance(value, int):
                value = whole(value)
            if not low <= value <= high:
                raise Fault(E.OUT_OF_RANGE)
            values[name] = value

        return write

    def _write_watched(self, name: str, value: Value) -> None:
        row = self.row(name)
        if row is not None:
            self._ranges.write(row, value)
        self._timeline.replan()

    def _write_error(self, value: Value) -> None:
        """Only 0 clears; programs also set a code of their own."""
        number = self._ranges.checked("ER", value)
        self._memory.values["ER"], self._memory.values["EF"] = number, int(number != 0)

    def _write_input_flag(self, value: Value) -> None:
        """Clearing IF ends what IV waits for."""
        self._memory.values["IF"] = self._ranges.flag("IF", value)
        self._memory.awaited = ""

    def _write_lock(self, value: Value) -> None:
        """A lock that has been saved is opened by CP or FD only (manual 5.1.75)."""
        number = self._ranges.checked("LK", value)
        if not number and self._memory.values["LK"] and self._saved_lock():
            raise Fault(E.PROGRAM_LOCKED)
        self._memory.values["LK"] = number

    def _write_baud(self, value: Value) -> None:
        row, number = self.row("BD"), whole(value)
        if row is None or not row.accepts(number):
            raise Fault(E.NO_SUCH_BAUD)
        self._memory.values["BD"] = number
