"""Parameters of a macro: `{NAME:TYPE=DEFAULT,LOW..HIGH}` in a line.

TYPE is `int`, `float`, `text` or `choice(A|B)`. Default and limits may be left out; without a default a value must be
given. A plain `{NAME}` takes the type that another line gives it, else it is a text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.text import visible

Value = int | float | str
LARGEST = 10**15
"""The largest magnitude of a number."""
_PLACE = re.compile(r"\{\{|\}\}|\{(?P<name>[A-Za-z0-9_-]+)(?::(?P<type>[^{}]*))?\}")
_TYPE = re.compile(r"\s*(?P<kind>int|float|text|choice\((?P<choices>[^()]*)\))\s*(?:=(?P<default>.*?))?\s*", re.DOTALL)
_LIMITS = re.compile(r"(?P<head>.*?),\s*(?P<low>[^,\s]*?)\s*\.\.\s*(?P<high>[^,\s]*)\s*", re.DOTALL)
_SET = re.compile(r"/set\s+(?P<name>[A-Za-z0-9_]+)")
_FORMS = {
    "int": re.compile(r"[+-]?\d{1,16}", re.ASCII),
    "float": re.compile(r"[+-]?(\d{1,16}(\.\d{0,16})?|\.\d{1,16})"),
}
_NAMES = {"int": "a whole number", "float": "a number"}
_USAGE = "valid: {NAME:int=10,1..100}, float, text, choice(a|b)"


@dataclass(frozen=True)
class Parameter:
    """A value that a macro takes. `default` None: it must be given. `low`, `high` None: no limit."""

    name: str
    kind: str = "text"
    default: Value | None = None
    low: int | float | None = None
    high: int | float | None = None
    choices: tuple[str, ...] = ()

    @property
    def valid(self) -> str:
        """The valid values, for a person."""
        if self.kind == "choice":
            return " or ".join(self.choices)
        if self.kind == "text":
            return "one line of text"
        return f"{_NAMES[self.kind]}{self._limits}"

    @property
    def _limits(self) -> str:
        low, high = (None if each is None else written(each) for each in (self.low, self.high))
        if low is not None and high is not None:
            return f", {low} to {high}"
        return f", {low} or more" if low is not None else f", {high} or less" if high is not None else ""

    @property
    def example(self) -> str:
        """A valid value."""
        if self.kind in ("text", "choice"):
            return self.choices[0] if self.choices else "x"
        return written(self.low if self.low is not None else min(0, self.high or 0))

    @property
    def summary(self) -> str:
        """Name, default and limits, as a list shows them: `turns=10 (a whole number, 1 to 100)`."""
        default = "" if self.default is None else f"={written(self.default)}"
        return f"{self.name}{default}" + ("" if self.kind == "text" else f" ({self.valid})")

    def take(self, text: str, where: str = "") -> Value:
        """Read a value. Raises Diagnostic with the valid ones."""
        found = _READ[self.kind](self, text)
        if found is None:
            raise Diagnostic(f"invalid {self.name} = {visible(text)!r}", where, f"valid: {self.valid}")
        return found

    def _text(self, text: str) -> str | None:
        return text if visible(text) == text else None

    def _choice(self, text: str) -> str | None:
        return text if text in self.choices else None

    def _number(self, text: str) -> int | float | None:
        if not _FORMS[self.kind].fullmatch(text):
            return None
        number = int(text) if self.kind == "int" else float(text)
        low = -LARGEST if self.low is None else self.low
        high = LARGEST if self.high is None else self.high
        return number if low <= number <= high else None


_READ: dict[str, Callable[[Parameter, str], Value | None]] = {
    "int": Parameter._number,
    "float": Parameter._number,
    "text": Parameter._text,
    "choice": Parameter._choice,
}


def written(value: Value) -> str:
    """The text of a value in a line; a number has no exponent."""
    if not isinstance(value, float):
        return str(value)
    from decimal import Decimal  # takes 1 ms to import, and only a fraction wants it

    text = format(Decimal(repr(value)), "f")
    return text.removesuffix(".0")


def plain(line: str) -> str:
    """The line with `{NAME}` in place of each `{NAME:TYPE}`."""
    return _PLACE.sub(lambda match: f"{{{match['name']}}}" if match["name"] else match[0], line)


def begins_with_value(line: str) -> bool:
    """Whether the first character of a line is that of a value."""
    match = _PLACE.match(line.lstrip())
    return match is not None and match["name"] is not None


def declared(lines: Sequence[tuple[str, str]]) -> tuple[Parameter, ...]:
    """The parameters of lines, each line with its place, in the order of the lines.

    A plain `{NAME}` that a `/set` of these lines sets is not a parameter. Raises Diagnostic for a wrong type, and where
    two lines give a name different ones.
    """
    own = {match["name"] for _, line in lines if (match := _SET.match(line.strip()))}
    found: dict[str, tuple[Parameter, str]] = {}
    plain_ones: dict[str, None] = {}
    for where, match in _places(lines):
        name = match["name"]
        plain_ones.setdefault(name)
        if match["type"] is None:
            continue
        parameter = _defined(name, match["type"], f"{where}: {match[0]}")
        before, first = found.setdefault(name, (parameter, where))
        if before != parameter:
            hint = f"write {{{name}}} in one of them, or the same type in both"
            raise Diagnostic(f"{match[0]} differs from {name} in {_last_word(first)}", where, hint)
    return tuple(found[n][0] if n in found else Parameter(n) for n in plain_ones if n in found or n not in own)


def _places(lines: Iterable[tuple[str, str]]) -> Iterable[tuple[str, re.Match[str]]]:
    for where, line in lines:
        for match in _PLACE.finditer(line):
            if match["name"]:
                yield where, match


def _last_word(where: str) -> str:
    return where.rpartition(", ")[2].rpartition(": ")[2]


def _defined(name: str, text: str, where: str) -> Parameter:
    """Parse `TYPE=DEFAULT,LOW..HIGH`."""
    limits = None if text.lstrip().startswith("text") else _LIMITS.fullmatch(text)
    match = _TYPE.fullmatch(limits["head"] if limits else text)
    if match is None:
        raise Diagnostic("invalid type of a value", where, _USAGE)
    kind = "choice" if match["choices"] is not None else match["kind"]
    choices = tuple(word.strip() for word in (match["choices"] or "").split("|")) if kind == "choice" else ()
    if kind == "choice" and (limits or not _are_words(choices)):
        raise Diagnostic("invalid choices", where, "valid: choice(a|b), each word once, without limits")
    low, high = (_limit(limits[end], kind, where) if limits else None for end in ("low", "high"))
    if low is not None and high is not None and low > high:
        raise Diagnostic(f"no value from {written(low)} to {written(high)}", where, "write the lower limit first")
    parameter = Parameter(name, kind, None, low, high, choices)
    if match["default"] is None:
        return parameter
    return Parameter(name, kind, parameter.take(match["default"].strip(), where), low, high, choices)


def _are_words(choices: Sequence[str]) -> bool:
    return len(set(choices)) == len(choices) and all(word and visible(word) == word for word in choices)


def _limit(text: str, kind: str, where: str) -> int | float | None:
    """Parse a limit; an empty one is none."""
    if not text:
        return None
    value = Parameter("limit", kind).take(text, where)
    assert not isinstance(value, str)  # no text and no choice has limits
    return value
