"""The language of expressions in scripts: `P > 100 and @b I1 == 1`, `(VM - offset) * 2`, `P == 512000 +- 2`.

Operands are numbers, text in quotation marks, names that the script set, and words of a drive, each of which is asked
for with one print. `[TEXT]` asks with a line of the drive's own language. `@ADDR` names the drive of the words after
it, up to the next `@ADDR`. An expression is parsed once, before anything is sent. Its words are then read, and its
value follows from them: no part of it is Python.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.shell.line_syntax import EVERYONE, split_target

Value = int | float | str
LARGEST_NUMBER = 10**15
"""The largest magnitude of a result. Whole numbers up to it are exact, and a loop cannot fill the memory with one."""
_NUMBER = re.compile(r"[+-]?(\d{1,16}(\.\d{0,16})?|\.\d{1,16})", re.ASCII)


def value_of(text: str) -> Value:
    """Read a value: a number where the text is one, else the text."""
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        return text
    return float(text) if "." in text else int(text)


def written(value: Value) -> str:
    """Write a value as a line and a message have it; a fraction has up to nine places."""
    if isinstance(value, float):
        text = f"{value:.9f}".rstrip("0").rstrip(".")
        return "0" if text == "-0" else text
    return str(value)


def quoted(value: Value) -> str:
    """Write a value for a message, with text in quotation marks."""
    return f'"{value}"' if isinstance(value, str) else written(value)


def _quotient(left: float, right: float) -> float:
    """Divide; whole numbers that divide without a rest stay whole."""
    whole = isinstance(left, int) and isinstance(right, int) and left % right == 0
    return left // right if whole else left / right


ARITHMETIC: Mapping[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": _quotient,
    "%": operator.mod,
}
ORDER: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
EQUAL = ("==", "!=")


def number(value: Value) -> int | float:
    """Return the value if it is a number. Raises Diagnostic."""
    if isinstance(value, str):
        raise Diagnostic(f"{quoted(value)} is not a number")
    return value


def calculated(sign: str, left: Value, right: Value) -> Value:
    """Calculate with two numbers. Raises Diagnostic for text, a division by 0, and a result that is too large."""
    first, second = number(left), number(right)
    if sign in "/%" and second == 0:
        raise Diagnostic(f"{written(first)} {sign} 0 has no result")
    result = ARITHMETIC[sign](first, second)
    if not abs(result) <= LARGEST_NUMBER:
        raise Diagnostic(f"{written(first)} {sign} {written(second)} is beyond {LARGEST_NUMBER:.0e}")
    return result


def compared(sign: str, left: Value, right: Value, within: Value = 0) -> bool:
    """Compare two values; `==` and `!=` with a tolerance. Text equals the same text only. Raises Diagnostic."""
    if sign not in EQUAL:
        return ORDER[sign](number(left), number(right))
    text = isinstance(left, str) or isinstance(right, str)
    equal = left == right if text else abs(number(left) - number(right)) <= number(within)
    return equal == (sign == "==")


DEEPEST_NESTING = 20
"""The deepest nesting."""
MOST_TOKENS = 200
"""The largest number of tokens."""


@dataclass(frozen=True)
class Constant:
    """A number or a text."""

    value: Value


@dataclass(frozen=True)
class Name:
    """A name that the script or `--set` sets."""

    name: str


@dataclass(frozen=True)
class DriveQuestion:
    """A question to a drive: a word of it, or with `line` a line of its language. `target` as after an `@`."""

    text: str
    target: str = ""
    line: bool = False

    @property
    def shown(self) -> str:
        """The question as written."""
        text = f"[{self.text}]" if self.line else self.text
        return f"@{self.target} {text}" if self.target else text


@dataclass(frozen=True)
class Measured:
    """A quantity, `{10 mm}`: it is compared with one word of a drive, whose scale makes a number of it."""

    text: str


@dataclass(frozen=True)
class Unary:
    """`-X` or `not X`."""

    sign: str
    operand: Expression


@dataclass(frozen=True)
class Binary:
    """Two operands and an arithmetic sign, `and` or `or`."""

    sign: str
    left: Expression
    right: Expression


@dataclass(frozen=True)
class Comparison:
    """Two operands and a comparison; `==` and `!=` have a tolerance."""

    sign: str
    left: Expression
    right: Expression
    within: Expression = field(default_factory=lambda: Constant(0))


Expression = Constant | Name | DriveQuestion | Measured | Unary | Binary | Comparison
Known = Mapping[Name | DriveQuestion, Value]
"""The values of an expression's names and words."""


def unknowns(tree: Expression) -> Iterator[Name | DriveQuestion]:
    """The names and words of an expression, from left to right."""
    if isinstance(tree, Name | DriveQuestion):
        yield tree
    elif isinstance(tree, Unary):
        yield from unknowns(tree.operand)
    elif isinstance(tree, Binary):
        yield from unknowns(tree.left)
        yield from unknowns(tree.right)
    elif isinstance(tree, Comparison):
        for part in (tree.left, tree.right, tree.within):
            yield from unknowns(part)


def evaluate(tree: Expression, known: Known) -> Value:
    """Calculate an expression; a condition is 1 or 0. Raises Diagnostic."""
    if isinstance(tree, Constant):
        return tree.value
    if isinstance(tree, Name | DriveQuestion):
        return known[tree]
    if isinstance(tree, Measured):
        hint = "as in P > {10 mm}, or P == {10 mm} +- {0.1 mm}"
        raise Diagnostic(f"{tree.text} is not compared with one word of a drive", "", hint)
    if isinstance(tree, Unary):
        operand = number(evaluate(tree.operand, known))
        return -operand if tree.sign == "-" else int(not operand)
    left, right = evaluate(tree.left, known), evaluate(tree.right, known)
    if isinstance(tree, Comparison):
        return int(compared(tree.sign, left, right, evaluate(tree.within, known)))
    if tree.sign in ARITHMETIC:
        return calculated(tree.sign, left, right)
    both = (bool(number(left)), bool(number(right)))
    return int(all(both) if tree.sign == "and" else any(both))


def parse(text: str, names: Container[str]) -> Expression:
    """Parse an expression; `names` are those that the script has set. Raises Diagnostic."""
    return _ExpressionParser(text, names).whole()


def parse_check(text: str, names: Container[str], *, lists: bool = False) -> Comparison:
    """Parse the one comparison of a check. `lists`: brackets hold a list, or nothing. Raises Diagnostic."""
    tree = _ExpressionParser(text, names, lists).whole()
    if not isinstance(tree, Comparison):
        raise Diagnostic(f"{text.strip()} is not one comparison", hint="valid: [@ADDR] EXPR OP EXPR [+- N]")
    return tree


class _Token(NamedTuple):
    kind: str
    text: str


_TOKEN = re.compile(
    r"""\s*(?:(?P<number>\d+(?:\.\d*)?|\.\d+)
    |(?P<text>"[^"]*")
    |(?P<quantity>\{[^{}\s]+[ ][^{}\s]+\})
    |(?P<line>\[(?:"[^"]*"|[^\]"])*\])
    |(?P<address>@\S*)
    |(?P<word>[A-Za-z_][A-Za-z0-9_]*)
    |(?P<sign>\+-|==|!=|<=|>=|[-+*/%()<>])
    |(?P<wrong>\S))""",
    re.ASCII | re.VERBOSE,
)
_HINTS = {"=": "== compares", '"': "a text ends with a quotation mark", "[": "a line for a drive ends with ]"}
_LOGIC = ("and", "or", "not")
_LEVELS: tuple[Container[str], ...] = (("or",), ("and",), {*EQUAL, *ORDER}, ("+", "-"), ("*", "/", "%"))
"""The signs between two operands; the ones that bind most come last."""
_COMPARISON = 2


def _tokens(text: str) -> list[_Token]:
    tokens = [_token(match) for match in _TOKEN.finditer(text.rstrip())]
    if len(tokens) > MOST_TOKENS:
        raise Diagnostic(f"the expression has more than {MOST_TOKENS} parts", hint="calculate it in steps with /set")
    return tokens


def _token(match: re.Match[str]) -> _Token:
    kind = str(match.lastgroup)
    text = match[kind]
    if kind == "wrong":
        raise Diagnostic(
            f"{text} at column {match.start(kind) + 1} is not part of an expression", "", _HINTS.get(text, "")
        )
    return _Token("sign" if text in _LOGIC else kind, text)


_END = _Token("end", "")


class _ExpressionParser:
    def __init__(self, text: str, names: Container[str], lists: bool = False) -> None:
        self._lists = lists
        self._text = text.strip()
        self._tokens = [*_tokens(text), _END]
        self._names = names
        self._at = 0
        self._target = ""
        """The drive of the words that follow."""
        self._depth = 0

    def whole(self) -> Expression:
        tree = self._level(0)
        if self._next is not _END:
            raise Diagnostic(f"{self._next.text} is out of place in {self._text}", "", self._hint())
        return tree

    @property
    def _next(self) -> _Token:
        return self._tokens[self._at]

    def _hint(self) -> str:
        return "write + -N, as +- is the tolerance of == and !=" if self._next.text == "+-" else ""

    def _take(self) -> _Token:
        token = self._next
        self._at += token is not _END
        return token

    def _takes(self, signs: Container[str]) -> bool:
        return self._next.kind == "sign" and self._next.text in signs

    def _level(self, level: int) -> Expression:
        if level == len(_LEVELS):
            return self._operand()
        tree = self._level(level + 1)
        while self._takes(_LEVELS[level]):
            sign = self._take().text
            right = self._level(level + 1)
            if level == _COMPARISON:
                if not (sign in EQUAL and self._takes(("+-",))):
                    return Comparison(sign, tree, right)
                self._take()
                return Comparison(sign, tree, right, self._level(_COMPARISON + 1))
            tree = Binary(sign, tree, right)
        return tree

    def _operand(self) -> Expression:
        self._depth += 1
        if self._depth > DEEPEST_NESTING:
            raise Diagnostic(
                f"the expression is nested deeper than {DEEPEST_NESTING}", hint="calculate it in steps with /set"
            )
        try:
            token = self._take()
            return self._signed(token) if token.kind == "sign" else self._value(token)
        finally:
            self._depth -= 1

    def _signed(self, token: _Token) -> Expression:
        if token.text == "-":
            return Unary("-", self._operand())
        if token.text == "not":
            return Unary("not", self._level(_COMPARISON))
        if token.text != "(":
            raise Diagnostic(f"a value is missing before {token.text} in {self._text}")
        tree = self._level(0)
        if not self._takes((")",)):
            raise Diagnostic(f"a ) is missing in {self._text}", "", self._hint())
        self._take()
        return tree

    def _value(self, token: _Token) -> Expression:
        if token.kind == "number":
            value = value_of(token.text)
            if isinstance(value, str) or value > LARGEST_NUMBER:
                raise Diagnostic(
                    f"{token.text} has too many digits", hint=f"valid: up to {LARGEST_NUMBER:.0e}, 16 places"
                )
            return Constant(value)
        if token.kind == "text":
            return Constant(token.text[1:-1])
        if token.kind == "address":
            self._target = _target(token.text)
            return self._operand()
        if token.kind == "quantity":
            return Measured(token.text)
        if token.kind == "line":
            return DriveQuestion(
                token.text[1:-1].strip() if self._lists else _line(token.text), self._target, line=True
            )
        if token.kind == "word":
            return Name(token.text) if token.text in self._names else DriveQuestion(token.text, self._target)
        raise Diagnostic(f"a value is missing at the end of {self._text}" if self._text else "a value is missing")


def _target(text: str) -> str:
    target = text[1:]
    if not target:
        raise Diagnostic("no address after the @", hint="valid: @ADDR WORD")
    if split_target(target)[1] in EVERYONE:
        raise Diagnostic(f"{text} is every drive, and only one can be asked", hint="name one drive")
    return target


def _line(text: str) -> str:
    line = text[1:-1].strip()
    if not line:
        raise Diagnostic("[] asks nothing", hint="valid: [LINE], a line that prints one value")
    return line
