"""Program files, read for sending (MCode reference 3.3, section 9).

A file holds declarations, which are sent unchanged, a program between `PG <address>` and `PG`, and further lines, often
`S`. A remark begins with an apostrophe (manual 3.3) or a back-quote, or with the backslash that replaces one in some
copies, where that begins the line or follows a blank. It runs to the end of its line; quotation marks contain none.
Inside them a TAB is an ordinary character (programs for units have some); outside it is a blank. This module does not
check the language. It reports what cannot be sent, and what would be executed or stored unintentionally. So a file
without a program may hold only settings: the drive would execute a program whose PG was forgotten.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf

from multidrop.base.comments import outside
from multidrop.base.files import SourceLine, split_lines, wrong_characters
from multidrop.dialects.program_files import (
    LinePart,
    Problem,
    ProgramEntry,
    check_comment,
    check_enter,
    refuse,
    respelled,
)
from multidrop.families.lexium.manual.grammar import LineError, Token, check_groups, parse, tokens
from multidrop.families.lexium.manual.groups import DECLARING, TURNING
from multidrop.families.lexium.manual.statements import canonical
from multidrop.families.lexium.manual.table import lookup

LONGEST_PROGRAM_LINE = 64
"""Characters that a drive's receive buffer holds (5.1.102)."""

MARKS = re.compile(r"['`\\]")
"""Every character that can begin a remark. No statement has one outside quotation marks."""
_REMARK = re.compile(r"['`]|(?:(?<=[ \t])|^)\\")
_PROGRAM = re.compile(r"PG\s*=?\s*(\w*)\Z", re.IGNORECASE | re.ASCII)
_DECLARES = re.compile(r"(LB|VA)\s*=?\s*([A-Z]\w{0,2})", re.IGNORECASE | re.ASCII)


@dataclass(frozen=True)
class ProgramLine(SourceLine):
    """A line to send, and its section."""

    section: str
    """`variables` before the program, `program` from PG to PG, `save` after it."""
    column: int = field(default=1, compare=False)
    """The column of its text in the file, from 1."""

    @property
    def mark(self) -> str | None:
        """The address of a PG, empty for the PG that ends a program; None for any other line."""
        match = _PROGRAM.match(self.text)
        return match[1] if match else None

    @property
    def declares(self) -> str:
        """The name that its LB or VA declares, in capitals; empty for any other line."""
        match = _DECLARES.match(self.text)
        return match[2].upper() if match else ""


def read(text: str, name: str) -> list[ProgramLine]:
    """Read the lines to send, in order. Raises Diagnostic with the first error and the number of others.

    `name` is the file's name in a Diagnostic (`name:line:column`).
    """
    lines, problems = scan(text)
    refuse(problems, name)
    return lines


def scan(text: str) -> tuple[list[ProgramLine], list[Problem]]:
    """Read all lines that are not empty, and report what prevents sending them. Never fails."""
    raw = split_lines(text)
    lines = [
        ProgramLine(n, sent, "", len(line) - len(line.lstrip(" \t")) + 1)
        for n, line in enumerate(raw, 1)
        if (sent := bare(line))
    ]
    if not lines:
        return [], [Problem(1, 1, "nothing to send: no line but remarks and blanks")]
    names = frozenset(line.declares for line in lines if line.declares)
    problems = [Problem(*place, "lines end at LF or CR LF") for place in wrong_characters(raw)]
    problems += check_enter([line[: remark_at(line)] for line in raw], names)
    wrong = {problem.line for problem in problems}
    for line in lines:
        if line.number not in wrong:
            problems += _unsendable(line, raw[line.number - 1], names)
    sections, unpaired = _sections(lines)
    problems += unpaired
    if "program" not in sections:
        problems += _without_program(lines)
    placed = zip(lines, sections, strict=True)
    return [ProgramLine(line.number, line.text, section, line.column) for line, section in placed], problems


def bare(line: str) -> str:
    """Return a line of a file as it is sent: without its remark, and `spaced`."""
    return spaced(line[: remark_at(line)])


def spaced(line: str) -> str:
    """Return a line without indent and trailing blanks; tabs between words become blanks."""
    parts = line.split('"')
    spaced_line = '"'.join(part if at % 2 else part.replace("\t", " ") for at, part in enumerate(parts)).strip(" ")
    return line if spaced_line == line else spaced_line


def remark_at(line: str) -> int:
    """Find where the remark of a line begins: after its last character if it has none."""
    match = next(outside(line, _REMARK), None)
    return match.start() if match else len(line)


def commented(text: str) -> str:
    """Return why a line with a mark of a remark outside quotation marks is not sent; empty for any other line."""
    match = next(outside(text, MARKS), None)
    hint = 'leave it out (a text is in ")'
    return f"{match[0]} begins a comment, which only program files have; {hint}; nothing was sent" if match else ""


def formatted(text: str) -> str:
    """Return a program in canonical spelling. Remarks, blank lines, indents and the columns of remarks stay.

    A line that would become longer than a drive accepts stays as it is.
    """
    names = frozenset(line.declares for line in scan(text)[0] if line.declares)

    def spell(statement: str) -> str:
        spelled = canonical(statement, names)
        return spelled if len(spelled) <= LONGEST_PROGRAM_LINE else statement

    return respelled(text, remark_at, spell)


def unsendable(text: str) -> int | None:
    """Find the first character that cannot be sent: neither printable ASCII nor TAB; None for none."""
    return next((at for at, character in enumerate(text) if character != "\t" and not " " <= character <= "~"), None)


def _unsendable(line: ProgramLine, raw: str, names: frozenset[str]) -> Iterator[Problem]:
    """Report what cannot be sent as it was meant. `raw`: the line with its remark.

    That is a character that no drive takes, a line that is too long, a number in groups of digits, and a mark of a
    remark in the wrong place.
    """
    yield from check_comment(raw, line.number, remark_at(raw))
    at = unsendable(line.text)
    if at is not None:
        yield Problem(line.number, line.column + at, f"{line.text[at]!r} cannot be sent", "MCode is plain ASCII")
    if len(line.text) > LONGEST_PROGRAM_LINE:
        what = f"{len(line.text)} characters without the remark; a drive takes {LONGEST_PROGRAM_LINE}"
        yield Problem(line.number, line.column + LONGEST_PROGRAM_LINE, what, "split the line")
    try:
        check_groups(line.text, names)
    except LineError as wrong:
        yield Problem(line.number, line.column + wrong.column, wrong.why)
        return
    if (mark := next(outside(line.text, MARKS), None)) is not None:
        what = "a backslash begins a comment only at the start of a line or after a blank"
        yield Problem(line.number, line.column + mark.start(), what, "put a blank before it, or delete it")


def _sections(lines: list[ProgramLine]) -> tuple[list[str], list[Problem]]:
    """Find the section of each line, and report each PG without a partner.

    A PG without a partner counts as what it was meant to be, so it is reported once. A PG that ends a program of which
    no line is the begin ends the lines before it that are no settings: the line of their PG has another error.
    """
    opened: ProgramLine | None = None
    ended: float = inf
    names = frozenset(line.declares for line in lines if line.declares)
    since = 0
    inside: list[bool] = []
    problems: list[Problem] = []
    for at, line in enumerate(lines):
        inside.append(opened is not None or line.mark is not None)
        if line.mark is None:
            continue
        if opened is None and not line.mark:
            what, hint = "PG without an address, and no program to end", "begin with PG 1"
            problems.append(Problem(line.number, line.column, what, hint))
        if opened is not None and line.mark:
            what = f"{line.text} inside the program of line {opened.number}"
            problems.append(Problem(line.number, line.column, what, "end that with PG first"))
        following = next((each.mark for each in lines[at + 1 :] if each.mark is not None), None)
        opens = bool(line.mark) or (opened is None and following == "")  # where the next PG ends a program
        if opened is None and not opens:
            first = next((n for n in range(since, at) if not _is_setting(lines[n].text, names)), at)
            inside[first:at] = [True] * (at - first)
        opened, ended, since = (line if opens else None), line.number, at + 1
    if opened is not None:
        hint = "the program's last line is PG alone"
        problems.append(Problem(opened.number, opened.column, "PG is never ended", hint))
    around = ["save" if line.number > ended else "variables" for line in lines]
    return ["program" if within else other for within, other in zip(inside, around, strict=True)], problems


def _without_program(lines: list[ProgramLine]) -> Iterator[Problem]:
    """Warn of a file of settings; report lines that would be executed although they were meant to be stored."""
    names = frozenset(line.declares for line in lines if line.declares)
    for line in lines:
        if not _is_setting(line.text, names):
            hint = "a program is between PG <address> and PG"
            yield Problem(line.number, line.column, f"no program, and {line.text} is not a setting", hint)
            return
    yield Problem(lines[0].number, lines[0].column, "holds no program: settings only", warning=True)


def _is_setting(text: str, names: frozenset[str]) -> bool:
    """Whether a line only sets or declares a value, or saves the settings; also with an error after its `=`."""
    try:
        statement = parse(text, names)
    except LineError:
        word, equals, _ = text.partition("=")
        return bool(equals) and _holds_value(word.strip().upper(), names)
    if statement is None or statement.word in ("VA", "S"):
        return statement is not None
    return _holds_value(statement.word, names) and bool(statement.arguments)


def _holds_value(word: str, names: frozenset[str]) -> bool:
    row = lookup(word)
    return word in names or (row is not None and row.valued)


# The parts of a line of an MCode program for an editor, and the places at which a program can begin.


def parts(line: str) -> list[LinePart]:
    end = remark_at(line)
    line_tokens = tokens(line[:end])
    declares = bool(line_tokens) and line_tokens[0].text.upper() in DECLARING
    kinds = [(token, _kind(token, number, declares)) for number, token in enumerate(line_tokens)]
    shown = [LinePart(token.start, token.stop, kind) for token, kind in kinds if kind]
    return [*shown, LinePart(end, len(line), "remark")] if end < len(line) else shown


def _kind(token: Token, number: int, declares: bool) -> str:
    if token.kind == "text" or token.kind == "bad":
        return "wrong" if token.kind == "bad" or token.unclosed else "text"
    if token.kind != "word":
        return ""
    if declares and number == 1:
        return "label"
    row = lookup(token.text.upper())
    if row is None:
        return ""
    return "starts" if number == 0 and row.name in TURNING else "word"


def entries(text: str) -> list[ProgramEntry]:
    return [
        ProgramEntry(line.declares, line.number, f"EX {line.declares}")
        for line in scan(text)[0]
        if line.section == "program" and line.declares and line.text[:2].upper() == "LB"
    ]
