"""The program memory of a simulated PMX-2ED-SA: compiled lines, and where programs and subroutines begin."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.families.pmx.manual.script_compiler import ERASED, MEMORY_LINES, split

LONGEST_STORED_LINE = 24
"""Characters of a line; ten is the longest that units have shown, our names take more."""


class PmxMemory:
    """1275 lines. They are kept at once, without STORE."""

    def __init__(self) -> None:
        self.code: list[tuple[str, str] | None] = [None] * MEMORY_LINES
        """Each line taken apart; None for one that cannot be carried out."""
        self._lines = [ERASED] * MEMORY_LINES
        self._starts: dict[int, int] = {}
        self._subroutines: dict[int, int] = {}
        self._indexed = True

    def line(self, number: int) -> str:
        """`SA<number>`, 0 to 1274."""
        return self._lines[number]

    def store(self, number: int, text: str) -> bool:
        """`SA<number>=<text>`. False: the line is invalid (`?Invalid Answer`)."""
        if not _can_be_stored(text):
            return False
        self._lines[number] = text
        self.code[number] = split(text)
        self._indexed = False
        return True

    def load(self, lines: Sequence[str]) -> None:
        """Fill the memory with compiled lines, and erase the rest."""
        for number in range(MEMORY_LINES):
            self.store(number, lines[number] if number < len(lines) else ERASED)

    def start_of(self, program: int) -> int | None:
        """Find the first line of a program; None if there is none."""
        self._index()
        return self._starts.get(program)

    def subroutine(self, number: int) -> int | None:
        """Find the first line of a subroutine; None if it is not defined."""
        self._index()
        return self._subroutines.get(number)

    def _index(self) -> None:
        """Find where programs and subroutines begin, if lines have changed.

        Without PS0, program 0 begins at the first line outside of subroutines and of program 1.
        """
        if self._indexed:
            return
        self._starts, self._subroutines, self._indexed = {}, {}, True
        inside, loose = "", None
        for number, stored in enumerate(self.code):
            word, argument = stored or ("", "")
            if word == "PS":
                self._starts.setdefault(int(argument), number)
                inside = "XX"
            elif word == "SS":
                self._subroutines.setdefault(int(argument), number)
                inside = "SE"
            elif inside and word == inside:
                inside = ""
            elif not inside and loose is None and self._lines[number] != ERASED:
                loose = number
        if loose is not None:
            self._starts.setdefault(0, loose)


def _can_be_stored(text: str) -> bool:
    printable = text.isascii() and text.isprintable() and " " not in text
    return printable and 0 < len(text) <= LONGEST_STORED_LINE
