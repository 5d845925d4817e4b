"""The grammar of a line of MCode: tokens for colouring and completion, statements for checks and the simulator.

Theory of operation. A line is a head word and arguments. A space or `=`, which are equivalent, separates them, or
nothing where the head has one reading (`MR512`, `VAQ1=25`). Commas separate arguments; PR also takes them side by side.
An argument is a text in quotation marks, an expression, or a condition. Operators have no precedence: they apply from
left to right (the manual, 5.2, chains one operator only). So does a condition, with two exceptions. `+ - * /` after a
comparison belong to its right side (`P<R1+100`). `& | ^` and a second comparison take its result, 0 or 1 (see
`statements`). Words are not case-sensitive. A remark begins with an apostrophe or a back-quote outside quotation marks
and runs to the end.

The grammar gives words no meaning, except that it asks for the known words where a head may have to be split.
"""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf
from typing import NamedTuple

from multidrop.base.comments import grouped_at
from multidrop.families.lexium.manual.errors import ErrorNumber
from multidrop.families.lexium.manual.groups import FUNCTIONS, JOINED
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS, lookup

COMPARISONS = frozenset({"=", "<>", "<", "<=", ">", ">="})
SUMS = frozenset({"+", "-", "*", "/"})
LOGIC = frozenset({"&", "|", "^"})
OPERATORS = SUMS | LOGIC

READ_LINES = 4096
"""The number of lines that are kept as they were read: session, codec and conversation ask for the same one."""
LARGEST_NUMBER = 2**31
"""Beyond it no drive takes a whole number."""
MOST_TOKENS = 256
"""Far more than fit into a drive's 64 characters; limits the parser's recursion."""

_TOKEN = re.compile(
    r"""(?P<space>\s+)
      | (?P<remark>['`].*)
      | (?P<text>"[^"]*"?)
      | (?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
      | (?P<word>[CcLlSsTt]_|[A-Za-z][A-Za-z0-9]*)
      | (?P<op><>|<=|>=|=<|=>|[=<>+\-*/&|^!])
      | (?P<comma>,)
      | (?P<end>;)
      | (?P<bad>.)""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)
NAME_FORM = "a name is a letter, alone or with a letter, a digit or two digits"
_NAME = re.compile(r"[A-Z](?:[A-Z0-9]|[0-9]{2})?\Z")
_SWAPPED = {"=<": "<=", "=>": ">="}
_GROUP = re.compile(r"\d{3}(?:\.\d*)?", re.ASCII)
_GROUPED = re.compile(r"\d+(?:(?:\s*,\s*|\s+)[0-9]{3}(?![0-9]))+(?:\.[0-9]*)?")
_BINARY_FIELDS = frozenset({"<0/1>", "0", "1"})
"""What the syntax of a word calls a field that takes only 0 or 1."""


class Token(NamedTuple):
    """A part of a line. `kind` is text, number, word, op, comma, end, remark or bad; `start` its column from 0."""

    kind: str
    text: str
    start: int

    @property
    def stop(self) -> int:
        return self.start + len(self.text)

    @property
    def unclosed(self) -> bool:
        return self.kind == "text" and (len(self.text) < 2 or not self.text.endswith('"'))


class LineError(Exception):
    """A line that no drive accepts: the drive's error `code`, the column from 0, and the reason for a person."""

    def __init__(self, code: int, column: int, why: str) -> None:
        super().__init__(why)
        self.code, self.column, self.why = code, column, why


@dataclass(frozen=True)
class Number:
    """A number as written; a float if it has a point or an exponent."""

    value: int | float


@dataclass(frozen=True)
class NameTerm:
    """A mnemonic, a label or a user variable, in capitals."""

    word: str
    column: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Text:
    """A text in quotation marks, without them, escapes as written. Not `quoted`: a bare device name."""

    value: str
    quoted: bool = True


@dataclass(frozen=True)
class UnaryTerm:
    """`-`, `!` or a function word, with its operand."""

    op: str
    operand: Expression


@dataclass(frozen=True)
class BinaryTerm:
    """An arithmetic or bitwise operation."""

    op: str
    left: Expression
    right: Expression


@dataclass(frozen=True)
class Compare:
    """A comparison, whose value is 0 or 1; also the form of `VA Q1=25`."""

    op: str
    left: Expression
    right: Expression


Expression = Number | NameTerm | UnaryTerm | BinaryTerm | Compare
Argument = Expression | Text


@dataclass(frozen=True)
class Statement:
    """A line: the head in capitals (empty for a bare number), whether `=` follows it, and its arguments.

    `quiet` is PR's semicolon. A blank argument is None.
    """

    word: str
    arguments: tuple[Argument | None, ...] = ()
    equals: bool = False
    quiet: bool = False
    column: int = field(default=0, compare=False)


def is_name(word: str) -> bool:
    """Whether a word has the form of a label or variable: a letter, then nothing, one alphanumeric or two digits."""
    return _NAME.match(word.upper()) is not None


def tokens(line: str) -> list[Token]:
    """Return all tokens of a line, remark included, without spaces. Never fails."""
    return list(_tokens(line))


@lru_cache(maxsize=READ_LINES)
def _tokens(line: str) -> tuple[Token, ...]:
    tokens_so_far = []
    for match in _TOKEN.finditer(line):
        kind = match.lastgroup or "bad"
        if kind != "space":
            tokens_so_far.append(Token(kind, match.group(), match.start()))
    return tuple(tokens_so_far)


def words(line: str) -> set[str]:
    return {token.text.upper() for token in tokens(line) if token.kind == "word"}


def strip(line: str) -> str:
    """Return the line without its remark and outer spaces."""
    for token in tokens(line):
        if token.kind == "remark":
            return line[: token.start].strip()
    bare = line.strip()
    return line if bare == line else bare


def statement_tokens(line: str, names: Container[str] = ()) -> list[Token]:
    """Return the tokens of a statement without its remark; a head that touches its argument is divided. Never fails."""
    return divided([token for token in tokens(line) if token.kind != "remark"], names)


def parse(line: str, names: Container[str] = ()) -> Statement | None:
    """Parse a line; None if it is blank. `names` are the user's labels and variables, in capitals.

    Raises LineError.
    """
    statement = _read(line, names) if names else _read_alone(line)
    if isinstance(statement, LineError):
        raise LineError(statement.code, statement.column, statement.why)  # one that is kept would gather tracebacks
    return statement


@lru_cache(maxsize=READ_LINES)
def _read_alone(line: str) -> Statement | LineError | None:
    return _read(line)


def _read(line: str, names: Container[str] = ()) -> Statement | LineError | None:
    parts = statement_tokens(line, names)
    if not parts:
        return None
    if len(parts) > MOST_TOKENS:
        return LineError(ErrorNumber.ILLEGAL_DATA, parts[MOST_TOKENS].start, "the line is too long")
    try:
        return _LineParser(parts, len(line), names).statement()
    except LineError as error:
        return error


def parsed(line: str, names: Container[str] = ()) -> Statement | None:
    """Parse a line; None also for one that no drive accepts."""
    statement = _read(line, names) if names else _read_alone(line)
    return None if isinstance(statement, LineError) else statement


def check_groups(line: str, names: Container[str] = ()) -> None:
    """Raise LineError for a number in groups of three digits (`MA 200,000`), of which a drive reads the first.

    Three digits after a number and a comma or a space are such a group where the word has no further field, or a field
    that takes only 0 or 1. `PR` has as many fields as a line holds. A mark of a remark may divide groups: `MA 200'000`.
    So may a point: it is refused in a number alone where a word takes whole numbers. A drive reads `MA 200.000` as 200.
    """
    parts = divided(tokens(line), names)
    word = parts[0].text.upper() if parts and parts[0].kind == "word" else ""
    number, field, place = None, 0, 0
    for token in parts if word != "PR" else ():
        marked = token.kind in ("remark", "bad") and number is not None and number.stop == token.start
        if marked and (divides := grouped_at(line, token.start)) is not None:
            raise LineError(ErrorNumber.ILLEGAL_DATA, divides.start, divides.why)
        group = token.kind == "number" and _GROUP.fullmatch(token.text)
        if number is not None and group and _fields(word, place + 1) <= _BINARY_FIELDS:
            whole = _GROUPED.match(line, number.start)
            shown = whole[0].rstrip() if whole else line[number.start : token.stop]
            why = f"{shown} would be read as {number.text}; write {re.sub(r'[^0-9.]', '', shown)}"
            raise LineError(ErrorNumber.ILLEGAL_DATA, number.start, why)
        if token.kind == "number":
            number, place = token, field
        elif token.kind == "comma":
            field += 1
        elif not token.text.isspace():  # a space that is not ASCII is no token of the language
            number = None
    _check_points(parts)


def _check_points(found: Sequence[Token]) -> None:
    """Raise LineError for a point or an exponent of a word that takes whole numbers."""
    row = lookup(found[0].text.upper()) if found and found[0].kind == "word" else None
    if row is None or not row.whole:
        return
    argument = [token for token in found[1:] if token.kind != "remark" and not token.text.isspace()]
    if argument and argument[0].text == "=":
        del argument[0]
    for at, token in enumerate(argument):
        first = at == 0 or argument[at - 1].kind == "comma" or (at == 1 and argument[0].text in "+-")
        last = at == len(argument) - 1 or argument[at + 1].kind == "comma"
        if first and last and token.kind == "number" and not token.text.isdecimal():
            whole, _, fraction = token.text.partition(".")
            group = f", or {whole}{fraction}" if len(fraction) == 3 and fraction.isdecimal() else ""
            near = float(token.text)
            write = f"{near:.0f}{group}" if abs(near) < LARGEST_NUMBER else "a whole number"
            why = f"{token.text} is not whole, and {row.name} takes whole numbers; write {write}"
            raise LineError(ErrorNumber.ILLEGAL_DATA, token.start, why)


def _fields(word: str, at: int) -> set[str]:
    """What the forms of a word take in their field `at`, from 0, in any firmware; empty where no form has it."""
    rows = [table[word] for table in (MNEMONICS, MDRIVE) if word in table]
    forms = [re.sub(r"[][]", "", form) for row in rows for form in row.syntax.split(", ")]
    takes = [form[len(word) + 1 :].split(",") for form in forms if re.match(rf"{word}[ =]", form)]
    return {fields[at] for fields in takes if len(fields) > at}


def divided(found: list[Token], names: Container[str]) -> list[Token]:
    """Divide the head of a statement's tokens (`MR512`, `VAQ1`), where it is not a known word."""
    if not found:
        return found
    head = found[0]
    word = head.text.upper()
    if head.kind != "word" or word in names or lookup(word):
        return found
    equals = len(found) > 1 and found[1].text == "="
    for length in (2, 1):
        first, rest = word[:length], word[length:]
        if not rest or not lookup(first):
            continue
        if first[-1].isdigit():  # `R15` is not `R1 5`, and `D15` may be a typing error
            return found
        digits = rest.isdigit() and not (equals and is_name(word))
        if digits or (first in JOINED and (is_name(rest) or lookup(rest))):
            kind = "number" if rest.isdigit() else "word"
            tail = Token(kind, head.text[length:], head.start + length)
            return [Token("word", head.text[:length], head.start), tail, *found[1:]]
    return found


class _LineParser:
    """Recursive descent over the tokens of a line."""

    def __init__(self, found: list[Token], width: int, names: Container[str]) -> None:
        self.found: list[Token | None] = [*found, None]
        self.head, self.at, self.width, self.names = found[0], 0, width, names
        self.side = SUMS
        """The operators that belong to the right side of a comparison."""

    def statement(self) -> Statement:
        head = self.head
        if head.kind == "number" or head.text in "+-":
            value = self.expression(OPERATORS)
            self.finish()
            return Statement("", (value,))
        if head.kind != "word":
            raise LineError(ErrorNumber.UNKNOWN_COMMAND, head.start, f"a line cannot begin with {head.text!r}")
        self.at = 1
        word = head.text.upper()
        if word == "VA":  # its `=` assigns
            self.side = OPERATORS
        equals = self.take("=")
        quiet = False
        if word == "PR":
            arguments, quiet = self.prints()
        elif word == "DN" and (name := self.device_name()) is not None:
            arguments = (name,)
        else:
            arguments = self.arguments(ErrorNumber.ILLEGAL_DATA if word in ("LB", "VA") else ErrorNumber.NO_SEPARATOR)
        self.finish()
        return Statement(word, arguments, equals, quiet, head.start)

    def device_name(self) -> Text | None:
        """Return a letter without quotation marks in its own case; None for any other argument of DN."""
        token = self.found[self.at]
        if token is None:
            return None
        if token.unclosed or token.kind in ("op", "bad"):
            raise LineError(ErrorNumber.OUT_OF_RANGE, token.start, "a device name needs quotation marks")
        if token.kind != "word" or len(token.text) > 1 or self.found[self.at + 1] is not None:
            return None
        self.at += 1
        return Text(token.text, quoted=False)

    def prints(self) -> tuple[tuple[Argument | None, ...], bool]:
        items: list[Argument | None] = []
        while (token := self.found[self.at]) is not None and token.kind != "end":
            if items and token.kind == "comma":
                self.at += 1
            items.append(self.printed())
        return tuple(items), self.take(";")

    def printed(self) -> Argument:
        token = self.found[self.at]
        if token is None or token.kind in ("comma", "end"):
            column = self.width if token is None else token.start
            raise LineError(ErrorNumber.ILLEGAL_DATA, column, "a comma must stand between two items")
        item = self.text() if token.kind == "text" else self.operand()
        after = self.found[self.at]
        if after is not None and after.kind == "op":
            raise LineError(ErrorNumber.ILLEGAL_DATA, after.start, "PR prints values, not what is computed from them")
        return item

    def arguments(self, unseparated: int) -> tuple[Argument | None, ...]:
        """Parse the arguments; `unseparated` is the error of two without a comma between them."""
        items: list[Argument | None] = []
        while (token := self.found[self.at]) is not None:
            if token.kind == "comma":
                items.append(None)
            else:
                items.append(self.text() if token.kind == "text" else self.condition())
            token_after = self.found[self.at]
            if token_after is None:
                break
            if token_after.kind == "comma" and self.found[self.at + 1] is None:
                raise LineError(ErrorNumber.ILLEGAL_DATA, token_after.start, "nothing follows the comma")
            if token_after.kind != "comma":
                if token_after.kind in ("word", "number", "text"):
                    raise LineError(unseparated, token_after.start, f"a comma is missing before {token_after.text!r}")
                raise LineError(
                    ErrorNumber.ILLEGAL_DATA, token_after.start, f"{token_after.text!r} does not belong here"
                )
            self.at += 1
        return tuple(items)

    def condition(self) -> Expression:
        """Parse a value, or comparisons and logic from left to right."""
        value = self.expression(OPERATORS)
        while (token := self.found[self.at]) is not None and token.kind == "op":
            op = _SWAPPED.get(token.text, token.text)
            if op not in COMPARISONS | OPERATORS:
                break
            self.at += 1
            if op in COMPARISONS:
                value = Compare(op, value, self.expression(self.side))
            else:
                value = BinaryTerm(op, value, self.operand())
        return value

    def expression(self, operators: Container[str]) -> Expression:
        value = self.operand()
        while (token := self.found[self.at]) is not None and token.text in operators:
            self.at += 1
            value = BinaryTerm(token.text, value, self.operand())
        return value

    def operand(self) -> Expression:
        token = self.found[self.at]
        self.at += 1
        if token is None:
            raise LineError(ErrorNumber.ILLEGAL_DATA, self.width, "something is missing at the end")
        if token.kind == "number":
            digits = token.text
            value = int(digits) if digits.isdigit() and len(digits) < 20 else float(digits)
            if value == inf:
                raise LineError(ErrorNumber.ILLEGAL_DATA, token.start, f"{digits} is beyond any range")
            return Number(value)
        if token.kind == "word":
            word = token.text.upper()
            if word in FUNCTIONS and word not in self.names and self.at_operand():
                return UnaryTerm(word, self.operand())
            return NameTerm(word, token.start)
        if token.text in ("-", "+", "!"):
            operand = self.operand()
            if token.text == "+":
                return operand
            if token.text == "-" and isinstance(operand, Number):
                return Number(-operand.value)
            return UnaryTerm(token.text, operand)
        raise LineError(ErrorNumber.ILLEGAL_DATA, token.start, _misplaced(token))

    def at_operand(self) -> bool:
        """Whether an operand follows: a function's word alone is a name on drives without functions."""
        token = self.found[self.at]
        return token is not None and (token.kind in ("number", "word") or token.text in ("-", "+", "!"))

    def text(self) -> Text:
        token = self.found[self.at]
        assert token is not None
        self.at += 1
        if token.unclosed:
            raise LineError(ErrorNumber.ILLEGAL_DATA, token.start, "the text has no closing quotation mark")
        return Text(token.text[1:-1])

    def finish(self) -> None:
        if (token := self.found[self.at]) is not None:
            raise LineError(ErrorNumber.ILLEGAL_DATA, token.start, _misplaced(token))

    def take(self, text: str) -> bool:
        token = self.found[self.at]
        if token is None or token.text != text:
            return False
        self.at += 1
        return True


def _misplaced(token: Token) -> str:
    return f"{token.text!r} does not belong here"
