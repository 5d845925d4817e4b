"""Errors of an MCode program file, as far as its text shows them."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
from functools import reduce
from operator import or_

from multidrop.dialects.program_files import Problem, errors, in_order
from multidrop.families.lexium.manual import guards, program_file, program_flow
from multidrop.families.lexium.manual.grammar import (
    NAME_FORM,
    LineError,
    NameTerm,
    Number,
    Statement,
    is_name,
    parse,
    words,
)
from multidrop.families.lexium.manual.groups import CHANGING, PLACES, TRIPS
from multidrop.families.lexium.manual.help import form_of, out_of_range
from multidrop.families.lexium.manual.mnemonic import EVERY, Mnemonic
from multidrop.families.lexium.manual.program_file import ProgramLine
from multidrop.families.lexium.manual.program_flow import AT_POWER_UP, Flow
from multidrop.families.lexium.manual.statements import condition_of, condition_reading, is_mixed, names_in, words_of
from multidrop.families.lexium.manual.table import lookup

# The products that have all words of a program, and a warning of a program for other ones.


Read = Sequence[tuple[ProgramLine, Statement]]
"""The lines of a file that can be parsed, each with its statement."""
LISTED = 4
"""Words that a message names."""


def check_products(read: Read, names: frozenset[str], product: str) -> Iterator[Problem]:
    """Report that a program is for other products than this one, if it is for any. `names` are the user's."""
    used, changed = dict[str, ProgramLine](), set[str]()
    for line, statement in read:
        for word in words_of(statement):
            if lookup(word) is not None:
                used.setdefault(word, line)
            if word == statement.word or statement.word in CHANGING:
                changed.add(word)

    def lacks(word: str, row: Mnemonic | None, each: str) -> bool:
        return row is None or (each not in row.products and (word in changed or each not in row.zero_on))

    def unfit(each: str) -> tuple[list[str], list[str]]:
        """Words that a product does not execute, and its own words that are a user's names."""
        rows = {word: lookup(word, each) for word in used}
        missing = [word for word, row in rows.items() if word not in names and lacks(word, row, each)]
        return missing, [word for word, row in rows.items() if word in names - {AT_POWER_UP} and row is not None]

    def some(found: Sequence[str]) -> str:
        return ", ".join(found[:LISTED]) + (" and others" if len(found) > LISTED else "")

    missing, taken = unfit(product)
    kin = sorted(EVERY, key=lambda each: (each[:2] != product[:2], each))
    fit = [each for each in kin if unfit(each) == ([], [])]
    if not fit or not (missing or taken):
        return
    reasons = [f"no {product} has {some(missing)}"] if missing else []
    reasons += [f"{product} has {some(taken)} as its own"] if taken else []
    line = used[(missing or taken)[0]]
    choice = f"{', '.join(fit[:-1])} or {fit[-1]}" if fit[1:] else fit[0]
    what = f"this is a program for {choice}: {', and '.join(reasons)}"
    yield Problem(line.number, line.column, what, f"check it with --personality {fit[0]}", warning=True)


# Warnings of trips that are set up and never enabled, and the reverse (MCode reference 5.1.125 to 5.1.132).


EXCLUSIVE = TRIPS["TP"] | TRIPS["TR"]


def check_trips(read: Read, mentioned: Container[str]) -> Iterator[Problem]:
    """Report trips without TE, and TE without trips. `mentioned` are words that lines with an error have."""
    first = {statement.word: (line, statement) for line, statement in reversed(read) if statement.arguments}
    enables = list[tuple[ProgramLine, Statement, int | None]]()
    """The lines that give TE a number; None for one that the text does not show."""
    for line, statement in read:
        if statement.word == "TE" and statement.arguments:
            number = statement.arguments[0]
            shown = isinstance(number, Number) and isinstance(number.value, int)
            enables.append((line, statement, int(number.value) if isinstance(number, Number) and shown else None))
    if all(bits is not None for *_, bits in enables) and "TE" not in mentioned:
        enabled = reduce(or_, (bits or 0 for *_, bits in enables), 0)
        for word, bit in TRIPS.items():
            if word in first and not enabled & bit:
                line, statement = first[word]
                what = f"{word} is set up, but TE never enables it"
                hint = f"TE={bit} enables it, after each trip again"
                yield Problem(line.number, line.column + statement.column, what, hint, warning=True)
    for line, statement, bits in enables:
        if (bits or 0) & EXCLUSIVE == EXCLUSIVE:
            what = "TE enables TP and TR together, which exclude each other: a drive refuses it (error 39)"
            hint = "enable one of them: 2 is TP, 16 is TR"
            yield Problem(line.number, line.column + statement.column, what, hint, warning=True)
    missing = {word: bit for word, bit in TRIPS.items() if word not in first and word not in mentioned}
    # Report the first TE for each set of trips that nothing sets up.
    reported = set[str]()
    for line, statement, bits in enables:
        words = [word for word, bit in missing.items() if (bits or 0) & bit and word not in reported]
        if words:
            reported.update(words)
            what = f"TE enables {', '.join(words)}, which nothing in this file sets up"
            yield Problem(
                line.number, line.column + statement.column, what, "a drive refuses it: error 27", warning=True
            )


read = program_file.read
formatted = program_file.formatted
parts = program_file.parts
entries = program_file.entries
"""With `check` and `measure` this module is a `FileLanguage`."""


def check(text: str, product: str = "") -> list[Problem]:
    """Report lines that no drive accepts, PG without a partner, undefined names, and warn of what looks forgotten.

    A word that `product` leaves free is a name; without a product every word of any table is known.
    """
    lines, problems = program_file.scan(text)
    unsendable = {problem.line for problem in problems if not problem.warning}
    reader = _StatementReader(lines, product=product)
    for line in lines:
        if line.number not in unsendable:
            problems += reader.read(line)
    problems += _forgotten(lines, reader, {error.line for error in errors(problems)})
    return in_order(problems)


def _forgotten(lines: Sequence[ProgramLine], reader: _StatementReader, wrong: Container[int]) -> Iterator[Problem]:
    """Warn of what the correct lines do together. A line with an error may have what others lack."""
    correct = {number: each for number, each in reader.statements.items() if number not in wrong}
    read = [(line, correct[line.number]) for line in lines if line.number in correct]
    doubtful = frozenset[str]().union(*(words(line.text) for line in lines if line.number in wrong))
    flow = Flow(lines, correct, reader.names)
    yield from program_flow.check_paths(flow, doubtful)
    yield from program_flow.check_moves(flow)
    words_of_drives = [each for each in read if each[1].word not in reader.names]
    yield from check_trips(words_of_drives, doubtful)
    # A variable of a program that no other line has; a global variable may be the host's.
    used = set[str]().union(*({*words_of(statement)} - {line.declares} for line, statement in read))
    for line, statement in read:
        name = line.declares if statement.word == "VA" and line.section == "program" else ""
        if name and name not in used and name not in doubtful:
            hint = "delete it, or declare it before PG for a host to use"
            yield Problem(line.number, line.column, f"the variable {name} is never used", hint, warning=True)
    yield from _when_executed(words_of_drives, reader.product)
    if reader.product in EVERY:
        parsed = [(line, reader.statements[line.number]) for line in lines if line.number in reader.statements]
        yield from check_products(parsed, reader.names, reader.product)


def _when_executed(read: Read, product: str) -> Iterator[Problem]:
    """Warn of lines outside of a program that act at a download, and of numbers that a drive refuses later."""
    programs = any(line.section == "program" for line, _ in read)  # else an instruction is an error
    for line, statement in read:
        column = line.column + statement.column
        if line.section == "program":
            if statement.word == "PR" and guards.prints_reset(line.text):
                yield Problem(line.number, column, f"it {guards.RESETS}", "print another character", warning=True)
            if product in EVERY and (valid := out_of_range(statement, product)):
                what = f"{line.text} is out of range: a drive refuses it when it executes it (error 21)"
                yield Problem(line.number, line.column, what, valid, warning=True)
            continue
        guard = guards.find(line.text, address="", party=True, product=product, starts=lambda _: False)
        if guard is not None or (programs and guards.acts(line.text)):
            what = f"{line.text} is outside of PG: a download executes it at once, and asks before"
            yield Problem(line.number, column, what, "move it into the program", warning=True)


def slips(lines: Sequence[ProgramLine], variables: Iterable[str]) -> list[Problem]:
    reader = _StatementReader(lines, variables)
    return [problem for line in lines for problem in reader.read(line) if not problem.warning]


def measure(text: str) -> str:
    """Count the lines; only the drive counts the bytes that they take."""
    inside = [line for line in program_file.read(text, "program") if line.section == "program"]
    return f"{sum(line.mark is None for line in inside)} lines of program"


class _StatementReader:
    """The statements of a file in turn, with all names that it declares."""

    def __init__(self, lines: Sequence[ProgramLine], more: Iterable[str] = (), product: str = "") -> None:
        self.names = frozenset(more).union(line.declares for line in lines if line.declares)
        self.labels: dict[str, int] = {}
        self.product = product
        self.statements: dict[int, Statement] = {}
        """By the number of the line, also where it names what there is not."""

    def read(self, line: ProgramLine) -> Iterator[Problem]:
        try:
            statement = parse(line.text, self.names)
        except LineError as wrong:
            hint = form_of(line.text, self.product)
            yield Problem(line.number, line.column + wrong.column, wrong.why, hint)
            return
        if statement is None:
            return
        self.statements[line.number] = statement
        word = statement.word
        if word and word not in self.names and lookup(word, self.product) is None:
            hint = _elsewhere(word) or ("is VA or LB missing?" if is_name(word) else NAME_FORM)
            yield Problem(line.number, line.column + statement.column, f"unknown name {word}", hint)
            return
        yield from self.label(line, statement)
        yield from self.places(line, statement)
        # Warn of a condition that exceeds the manual's form.
        condition = condition_of(statement)
        if condition is None or not is_mixed(condition):
            return
        first = next(names_in(condition), None)
        column = first.column if first else statement.column
        hint = "the manual allows one comparison; split it into two lines to be sure"
        what = f"more than one comparison is read as {condition_reading(condition)}"
        yield Problem(line.number, line.column + column, what, hint, warning=True)

    def label(self, line: ProgramLine, statement: Statement) -> Iterator[Problem]:
        first = statement.arguments[0] if statement.arguments else None
        if statement.word != "LB" or not isinstance(first, NameTerm):
            return
        if first.word in self.labels:
            what = f"LB {first.word} is already in line {self.labels[first.word]}"
            yield Problem(line.number, line.column + first.column, what, "rename one of them")
        self.labels.setdefault(first.word, line.number)

    def places(self, line: ProgramLine, statement: Statement) -> Iterator[Problem]:
        at = PLACES.get(statement.word)
        for place, argument in enumerate(statement.arguments):
            for name in names_in(argument):
                state = lookup(name.word, self.product) is not None
                if name.word in self.names or (state and place != at):
                    continue
                what = f"no label {name.word}" if place == at else f"unknown name {name.word}"
                hint = f"LB {name.word} is missing" if place == at else _elsewhere(name.word) or "is VA missing?"
                yield Problem(line.number, line.column + name.column, what, hint)


def _elsewhere(word: str) -> str:
    """Explain a word that only drives of another firmware have; empty for any other."""
    if lookup(word) is None:
        return ""
    return "other drives have it (--personality says which this is for); as a name it needs VA"
