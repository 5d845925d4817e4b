"""Programs for an MDrivePlus made into programs for a Lexium MDrive (`program convert --to lexium`).

`to_lexium.csv` has the conversions. A row with a `form` is about a whole statement: a regular expression of its
canonical spelling. The first one that fits counts. A row with a `word` is about that word of any other statement; `C2
in PR` only of PR. `becomes` is the new statement or word; `=`: it stays; empty: it is refused. `why` is for a person.
Words that the Lexium lacks and values out of its range are refused by its table, without a row. A name of the program
that is a word of the Lexium gets another one. Everything else is one language.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product as combinations
from random import Random
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.base.files import rows, split_lines
from multidrop.dialects.program_files import Conversion, Problem
from multidrop.families.lexium.manual import program_file
from multidrop.families.lexium.manual.grammar import Number, Statement, parsed, statement_tokens
from multidrop.families.lexium.manual.groups import EVERY_PLACE
from multidrop.families.lexium.manual.help import out_of_range
from multidrop.families.lexium.manual.points import FIRST_OUTPUT
from multidrop.families.lexium.manual.program_checker import check
from multidrop.families.lexium.manual.program_file import ProgramLine
from multidrop.families.lexium.manual.program_flow import AT_POWER_UP
from multidrop.families.lexium.manual.statements import spelled, words_of
from multidrop.families.lexium.manual.table import lookup

SOURCES = ("MDI", "MDIE", "MDIX")
TARGETS = ("LMDCM", "LMDOM", "LMDCE", "LMDOE")
"""The products to convert for, the usual one first."""
TABLE = list(rows(__file__, "to_lexium.csv"))
CALCULATED: Mapping[str, Callable[[int], object]] = {
    "counts": lambda counts: counts * 4,
    "above": lambda counts: counts * 4 + 3,
    "character": chr,
}
"""What a row calculates from a number: `counts(512)`. A reading above 512 of 10 bits is one above 2051 of 12.

`outputs(13)` leaves the bits of outputs that the file sets up.
"""
_CALCULATION = re.compile(r"([a-z]+)\((\d+)\)")
STEPS_PER_MICROSTEP = 10_000
"""VM and SL of a Lexium are at most MS times this."""


def source(text: str) -> str:
    """The simplest MDrivePlus that has all words of a program. Raises Diagnostic where it is for other products."""
    for product in SOURCES:
        wrong = next(
            (problem for problem in check(text, product) if problem.what.startswith("this is a program for")), None
        )
        if wrong is None:
            return product
    assert wrong is not None
    raise Diagnostic(wrong.what, f"line {wrong.line}", "valid: a program for an MDrivePlus (MDI, MDIE, MDIX)")


def convert(text: str, product: str) -> Conversion:
    """Convert a program that a check has found correct."""
    return _Converter(text, product).convert()


class _Converter:
    """One program on its way to one product."""

    def __init__(self, text: str, product: str) -> None:
        self.raw, self.product = split_lines(text), product
        self.end = "\r\n" if "\r\n" in text else "\n"
        self.lines = program_file.scan(text)[0]
        names = frozenset(line.declares for line in self.lines if line.declares)
        read = ((line, parsed(line.text, names)) for line in self.lines)
        self.read = [(line, statement) for line, statement in read if statement is not None]
        self.renamed = self._renamed(names)
        self.old_names, self.names = names, frozenset(self.renamed.get(name, name) for name in names)
        self.places = {0, 1, *(int(line.mark) for line in self.lines if line.mark and line.mark.isdigit())}
        self.outputs = {
            int(statement.word[1])
            for _, statement in self.read
            if re.fullmatch(r"S[1-4]=(1[6-9]|2\d).*", spelled(statement, names))
        }
        """The points that the program makes outputs."""
        mask = sum(1 << n - 1 for n in self.outputs)
        self.calculated: Mapping[str, Callable[[int], object]] = {**CALCULATED, "outputs": lambda bits: bits & mask}
        sizes = [
            int(argument.value)
            for _, statement in self.read
            for argument in statement.arguments
            if statement.word == "MS" and isinstance(argument, Number)
        ]
        self.fastest = min(sizes, default=256) * STEPS_PER_MICROSTEP
        self.changes: list[Problem] = []
        self.refused: list[Problem] = []

    def _renamed(self, names: frozenset[str]) -> dict[str, str]:
        """New names for those of the program that are words of the product."""
        taken, renamed = set(names), dict[str, str]()
        for name in sorted(names - {AT_POWER_UP}):
            if lookup(name, self.product) is not None:
                choice = (f"{letter}{digit}" for letter in name[0] + "QXYZ" for digit in range(10))
                renamed[name] = next(letter for letter in choice if letter not in taken and lookup(letter) is None)
                taken.add(renamed[name])
        return renamed

    def convert(self) -> Conversion:
        for line, statement in self.read:
            self._line(line, statement)
        bare, inserted = next((line for line, statement in self.read if not statement.word), None), 0
        if bare is not None and not any(statement.word == "NE" for _, statement in self.read):
            inserted = next(line.number for line in self.lines if line.section == "program")
            self.raw.insert(inserted - 1, "NE=1")
            self._change(
                bare, f"NE=1 is new, before line {inserted}", "NE of a new Lexium is 0: a bare number is error 24"
            )
        return Conversion(self.end.join(self.raw), self.changes, self.refused, inserted)

    def _line(self, line: ProgramLine, statement: Statement) -> None:
        at = EVERY_PLACE.get(statement.word)
        place = statement.arguments[at] if at is not None and len(statement.arguments) > at else None
        if isinstance(place, Number) and place.value not in self.places:
            self._refuse(line, f"{line.text}: address {place.value} is within a program", "give that line a label (LB)")
        why = [
            f"{word} is a word of an {self.product}; a host that uses the name must change it too"
            for word in dict.fromkeys(words_of(statement))
            if word in self.renamed
        ]
        text = _replaced(line.text, self.renamed, self.old_names)
        new, reasons = self._by_form(line, parsed(text, self.names) or statement)
        if new == "":
            new, reasons = self._by_word(line, text, statement)
        if new is None:
            return
        if new != line.text and (why or reasons):
            self._change(line, f"{line.text} is now {new}", "; ".join((*why, *reasons)))
            old, start = self.raw[line.number - 1], line.column - 1
            self.raw[line.number - 1] = old[:start] + new + old[start + len(line.text) :]
        self._check(line, new)

    def _by_form(self, line: ProgramLine, statement: Statement) -> tuple[str | None, Sequence[str]]:
        """Apply the first row whose form fits: the new statement; None: it is refused; empty: no row fits."""
        canonical = spelled(statement, self.names)
        if statement.word in ("OL", "OT") and not self.outputs and canonical[2:] != "=0":
            why = "set up the outputs in the file (S1=16,<active>), so that it is known which points they are"
            self._refuse(line, f"{line.text} cannot be converted", why)
            return None, ()
        for row in TABLE:
            match = re.fullmatch(row["form"], canonical) if row["form"] else None
            if match is None:
                continue
            why = match.expand(row["why"])
            if not row["becomes"]:
                self._refuse(line, f"{line.text} cannot be converted", why)
                return None, ()
            new = canonical if row["becomes"] == "=" else match.expand(row["becomes"])
            new = _CALCULATION.sub(lambda each: str(self.calculated[each[1]](int(each[2]))), new)
            if new != canonical:
                return new, [why]
            self._note(line, why)
            return line.text, ()
        return "", ()

    def _by_word(self, line: ProgramLine, text: str, statement: Statement) -> tuple[str | None, Sequence[str]]:
        """Apply the rows of its words: the new line; None: it is refused."""
        others, why = dict[str, str](), list[str]()
        for word in dict.fromkeys(words_of(statement)):
            row = next((each for each in TABLE if each["word"] in (word, f"{word} in {statement.word}")), None)
            if word[0] == "I" and word[1:] in map(str, self.outputs):
                self._refuse(line, f"{line.text}: point {word[1]} is an output", "a Lexium cannot read its outputs")
            if row is None or word in self.old_names:
                continue
            if not row["becomes"]:
                self._refuse(line, f"{line.text} cannot be converted", row["why"])
                return None, ()
            if row["becomes"] == "=":
                self._note(line, f"{word}: {row['why']}")
            else:
                others[word] = row["becomes"]
                why.append(row["why"])
        return _replaced(text, others, self.names), why

    def _check(self, line: ProgramLine, text: str) -> None:
        """Refuse words that the product lacks, and numbers out of its range."""
        statement = parsed(text, self.names)
        if statement is None:
            return
        for word in dict.fromkeys(words_of(statement)):
            row = lookup(word, self.product)
            if word not in self.names and (row is None or self.product not in row.products):
                self._refuse(line, f"{line.text}: no {self.product} has {word}", "")
        valid = out_of_range(statement, self.product)
        first = statement.arguments[0] if statement.word in ("VM", "SL") and statement.arguments else None
        if isinstance(first, Number) and abs(first.value) > self.fastest:
            valid = f"{statement.word} is at most MS*{STEPS_PER_MICROSTEP}, here {self.fastest}"
        if valid:
            self._refuse(line, f"{line.text} is out of range", valid)

    def _note(self, line: ProgramLine, why: str) -> None:
        """Name what differs though the line stays: once for each matter."""
        if why and why not in (change.hint for change in self.changes):
            self._change(line, f"{line.text} stays", why)

    def _change(self, line: ProgramLine, what: str, why: str) -> None:
        self.changes.append(Problem(line.number, line.column, what, why, warning=True))

    def _refuse(self, line: ProgramLine, what: str, why: str) -> None:
        self.refused.append(Problem(line.number, line.column, what, why))


def _replaced(text: str, others: Mapping[str, str], names: frozenset[str]) -> str:
    """A line with other words in place of some; texts in quotation marks stay."""
    for token in reversed(statement_tokens(text, names) if others else []):
        if token.kind == "word" and token.text.upper() in others:
            text = text[: token.start] + others[token.text.upper()] + text[token.stop :]
    return text


# The worlds in which a program and its conversion run beside each other.

MOST_WORLDS = 40
"""The largest number of worlds; of more they are drawn, the same ones each time."""
PULSE = (0.5, 1.0)
SWITCHES = {1: ("home", (-30000, 30000)), 2: ("limit_plus", (40000, None)), 3: ("limit_minus", (-40000, None))}
"""The types of inputs that are switches: the key of the world, and its values; None: there is none."""
World = Mapping[str, Any]
Part = tuple[str, World, World]
"""A description, and what it adds to the world of the program and to that of its conversion."""


def worlds(text: str) -> Iterator[Part]:
    """Yield worlds that differ in what a program's inputs see."""
    lines = program_file.scan(text)[0]
    names = frozenset(line.declares for line in lines if line.declares)
    read = [statement for line in lines if (statement := parsed(line.text, names)) is not None]
    drawn = list(combinations(*_parts(read)))
    if len(drawn) > MOST_WORLDS:
        drawn = Random("conversion").sample(drawn, MOST_WORLDS)
    for parts in drawn:
        said = ", ".join(part[0] for part in parts if part[0])
        yield said or "no input active", _merged([part[1] for part in parts]), _merged([part[2] for part in parts])


def _parts(read: Sequence[Statement]) -> Iterator[list[Part]]:
    """Yield for each input the parts that it can add."""
    types = dict.fromkeys(range(1, 5), (0, 0))
    limits = {0, 512, 1023}
    for statement in read:
        numbers = [int(part.value) for part in statement.arguments if isinstance(part, Number)]
        if re.fullmatch("S[1-4]", statement.word) and len(numbers) > 1:
            types[int(statement.word[1])] = (numbers[0], numbers[1])
        match = re.search(r"I5[<>=]+(\d+)", spelled(statement))
        limits |= {max(int(match[1]) + step, 0) for step in (-1, 0, 1)} if match else set()
    for n, (kind, active) in types.items():
        if kind in SWITCHES:
            key, places = SWITCHES[kind]
            tables: list[World] = [{} if place is None else {key: place} for place in places]
            yield [
                (f"{key} {place}" if table else "", table, table) for place, table in zip(places, tables, strict=True)
            ]
        elif kind < FIRST_OUTPUT:
            off, on = 1 - active, active
            levels = {
                "": [[0.0, n, off]],
                f"input {n} active": [[0.0, n, on]],
                f"input {n} active for a moment": [[0.0, n, off], [PULSE[0], n, on], [PULSE[1], n, off]],
            }
            yield [(said, {"inputs": level}, {"inputs": level}) for said, level in levels.items()]
    if any("I5" in words_of(statement) for statement in read):
        few = sorted(limits)
        yield [(f"I5 {c}", {"analog": [[0.0, c]]}, {"analog": [[0.0, c * 4 + 2]]}) for c in few if c <= 1023]


def _merged(tables: Sequence[World]) -> World:
    """One table; lists are joined."""
    merged = dict[str, Any]()
    for table in tables:
        for key, value in table.items():
            merged[key] = [*merged.get(key, []), *value] if isinstance(value, list) else value
    return merged
