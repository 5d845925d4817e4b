"""The ranges of a product's words, as the table of mnemonics gives them."""

from __future__ import annotations

from functools import lru_cache

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.table import Mnemonic, lookup
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import Value, whole
from multidrop.simulator.lexium.state.memory import Memory


@lru_cache(maxsize=4096)
def row_of(word: str, product: str) -> Mnemonic | None:
    """The table's row of a word that a product knows; None where it is a free name. Raises Fault (37)."""
    row = lookup(word, product)
    if row is not None and product not in row.products:
        raise Fault(E.NOT_AVAILABLE)
    return row


def within(value: Value, low: Value, high: Value) -> Value:
    """A value in a range. Raises Fault (21)."""
    if not low <= value <= high:
        raise Fault(E.OUT_OF_RANGE)
    return value


class Ranges:
    """What the words of one drive take; some ranges depend on whether it counts."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def row(self, word: str) -> Mnemonic | None:
        """The row of a word, None for a free name. Raises Fault (37)."""
        return row_of(word, self._memory.product)

    def checked(self, word: str, value: Value) -> int:
        """A whole number that a word takes. Raises Fault (21, 37)."""
        number = whole(value)
        if not self.takes(word, number):
            raise Fault(E.OUT_OF_RANGE)
        return number

    def flag(self, word: str, value: Value) -> int:
        """A value for a flag that the drive sets: 0 clears it, another value only where it may be written.

        Raises Fault (21).
        """
        row, number = self.row(word), whole(value)
        writable = row is not None and row.access == "RW" and row.accepts(number)
        if number != 0 and not writable:
            raise Fault(E.OUT_OF_RANGE)
        return number

    def takes(self, word: str, value: Value) -> bool:
        """Whether a word takes a value, in the unit that is in force."""
        row = self.row(word)
        return row is not None and row.accepts(value, self._memory.counting)

    def write(self, row: Mnemonic, value: Value) -> None:
        """Write a variable whose range depends on EE, or that takes certain numbers only. Raises Fault (21)."""
        if not isinstance(row.default, float):
            value = whole(value)
        if not row.accepts(value, self._memory.counting):
            raise Fault(E.OUT_OF_RANGE)
        self._memory.values[row.name] = value
