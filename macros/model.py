"""A macro: lines as typed, with the seconds between them, the values that they take, and the rules for its parts.

Braces in a line: `{NAME}` takes a value; `{{` and `}}` are literal braces. `{NAME:TYPE=DEFAULT,LOW..HIGH}` also says
what is valid. TYPE is `int`, `float`, `text` or `choice(A|B)`. Default and limits may be left out; without a default a
value must be given. A plain `{NAME}` takes the type that another line gives it, else it is a text. `{12.5 mm}` is a
quantity and stays; a value that is one is in braces, too, but in a text.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from multidrop.base.atomic import reserved
from multidrop.base.errors import Diagnostic
from multidrop.base.text import DECIMAL, counted, visible

_UNIT = r"(?:(?:[mcu]?m|in|deg|rad|m?turn)(?:/s2?|/min)?|m?rpm)"
_QUANTITY = rf"\{{{DECIMAL} [A-Za-z][A-Za-z0-9_/]*\}}"
"""A quantity, which is no name of a value: it has a space."""
_BRACES = re.compile(rf"(?P<quantity>{_QUANTITY})|\{{\{{|\}}\}}|\{{(?P<name>[A-Za-z0-9_-]+)\}}|[{{}}]", re.ASCII)
_VALUE = re.compile(rf"{DECIMAL} {_UNIT}", re.ASCII)
"""A value that is a quantity."""
_TEXTS = ("/print", "/expect")
"""Verbs that take text: a value that is a quantity is text there, too."""


def escape(line: str) -> str:
    """Double the braces of a line but those of quantities, so that `fill` returns it unchanged."""
    doubled = line.replace("{", "{{").replace("}", "}}")
    return re.sub(rf"\{{({_QUANTITY})\}}", r"\1", doubled, flags=re.ASCII)


def value_names(line: str) -> set[str]:
    return {match["name"] for match in _BRACES.finditer(line) if match["name"]}


def fill(line: str, values: Mapping[str, str], where: str = "") -> str:
    """Replace each `{NAME}` by its value. Raises Diagnostic for a missing value or a lone brace."""
    texts = line.split(maxsplit=1)[:1] in ([verb] for verb in _TEXTS)

    def one(match: re.Match[str]) -> str:
        name = match["name"]
        if match["quantity"]:
            return match[0]
        if name is None and len(match[0]) == 2:
            return match[0][0]
        if name is None:
            what = f"a lone {match[0]} at column {match.start() + 1}"
            raise Diagnostic(what, where, f"write {match[0] * 2} for a brace")
        if name not in values:
            raise Diagnostic(f"no value for {{{name}}}", where, f"set {name}=VALUE, or write {{{{ for a brace")
        value = values[name]
        quoted = texts or line.count('"', 0, match.start()) % 2
        return f"{{{value}}}" if not quoted and _VALUE.fullmatch(value) else value

    return _BRACES.sub(one, line)


Value = int | float | str
LARGEST_NUMBER = 10**15
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
class MacroParameter:
    """A value that a macro takes. `default` None: it must be given. `low`, `high` None: no limit."""

    name: str
    kind: str = "text"
    default: Value | None = None
    low: int | float | None = None
    high: int | float | None = None
    choices: tuple[str, ...] = ()

    @property
    def valid(self) -> str:
        if self.kind == "choice":
            return " or ".join(self.choices)
        if self.kind == "text":
            return "one line of text"
        low, high = (None if each is None else written(each) for each in (self.low, self.high))
        if low is not None and high is not None:
            return f"{_NAMES[self.kind]}, {low} to {high}"
        limit = f", {low} or more" if low is not None else f", {high} or less" if high is not None else ""
        return f"{_NAMES[self.kind]}{limit}"

    @property
    def example(self) -> str:
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
        if self.kind in _FORMS and _FORMS[self.kind].fullmatch(text):
            number = int(text) if self.kind == "int" else float(text)
            if _digits(written(number)) != _digits(text):
                raise Diagnostic(f"{self.name} = {text} has more digits than are kept", where, f"as {written(number)}")
            low = -LARGEST_NUMBER if self.low is None else self.low
            if low <= number <= (LARGEST_NUMBER if self.high is None else self.high):
                return number
        elif (self.kind == "text" and visible(text) == text) or (self.kind == "choice" and text in self.choices):
            return text
        raise Diagnostic(f"invalid {self.name} = {visible(text)!r}", where, f"valid: {self.valid}")


def _digits(text: str) -> str:
    """The digits of a number, without a sign and without zeros that change nothing."""
    whole, _, fraction = text.lstrip("+-").partition(".")
    return f"{whole.lstrip('0')}.{fraction.rstrip('0')}"


def written(value: Value) -> str:
    """The text of a value in a line; a number has no exponent."""
    if not isinstance(value, float):
        return str(value)
    from decimal import Decimal  # takes 1 ms to import, and only a fraction wants it

    text = format(Decimal(repr(float(value))), "f")  # a number of NumPy has another repr
    return text.removesuffix(".0")


def plain(line: str) -> str:
    """The line with `{NAME}` in place of each `{NAME:TYPE}`."""
    return _PLACE.sub(lambda match: f"{{{match['name']}}}" if match["name"] else match[0], line)


def declared(lines: Sequence[tuple[str, str]]) -> tuple[MacroParameter, ...]:
    """The parameters of lines, each line with its place, in the order of the lines.

    A plain `{NAME}` that a `/set` of these lines sets is not a parameter. Raises Diagnostic for a wrong type, and where
    two lines give a name different ones.
    """
    own = {match["name"] for _, line in lines if (match := _SET.match(line.strip()))}
    parameters: dict[str, tuple[MacroParameter, str]] = {}
    plain_ones: dict[str, None] = {}
    for where, line in lines:
        for match in _PLACE.finditer(line):
            if name := match["name"]:
                plain_ones.setdefault(name)
            if match["type"] is None:
                continue
            parameter = _defined(name, match["type"], f"{where}: {match[0]}")
            before, first = parameters.setdefault(name, (parameter, where))
            if before != parameter:
                hint = f"write {{{name}}} in one of them, or the same type in both"
                place = first.rpartition(", ")[2].rpartition(": ")[2]
                raise Diagnostic(f"{match[0]} differs from {name} in {place}", where, hint)
    return tuple(
        parameters[n][0] if n in parameters else MacroParameter(n)
        for n in plain_ones
        if n in parameters or n not in own
    )


def _defined(name: str, text: str, where: str) -> MacroParameter:
    """Parse `TYPE=DEFAULT,LOW..HIGH`."""
    limits = None if text.lstrip().startswith("text") else _LIMITS.fullmatch(text)
    match = _TYPE.fullmatch(limits["head"] if limits else text)
    if match is None:
        raise Diagnostic("invalid type of a value", where, _USAGE)
    kind = "choice" if match["choices"] is not None else match["kind"]
    choices = tuple(word.strip() for word in (match["choices"] or "").split("|")) if kind == "choice" else ()
    words = len(set(choices)) == len(choices) and all(word and visible(word) == word for word in choices)
    if kind == "choice" and (limits or not words):
        raise Diagnostic("invalid choices", where, "valid: choice(a|b), each word once, without limits")
    ends: list[int | float | None] = []
    for end in ("low", "high"):
        limit = MacroParameter("limit", kind).take(limits[end], where) if limits and limits[end] else None
        assert not isinstance(limit, str)  # no text and no choice has limits
        ends.append(limit)
    low, high = ends
    if low is not None and high is not None and low > high:
        raise Diagnostic(f"no value from {written(low)} to {written(high)}", where, "write the lower limit first")
    parameter = MacroParameter(name, kind, None, low, high, choices)
    if match["default"] is None:
        return parameter
    return MacroParameter(name, kind, parameter.take(match["default"].strip(), where), low, high, choices)


NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")
KEYS = tuple(f"F{number}" for number in range(2, 13))
"""The keys that can play a macro."""
FIRST_PAGE = "1"
"""The default page of a key."""
_PAGE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,15}")
_ROLE = re.compile(r"[A-Za-z0-9_-]+")


At = Callable[[str, int], str]
"""The place of a key: at the top, or in the step of that number. An empty key is the step itself."""


@dataclass(frozen=True)
class MacroStep:
    """One line, run `after` seconds after the start of the step before.

    `drive` and `replies` are what was recorded; they are read by people, and never sent.
    """

    after: float
    line: str
    drive: str = ""
    replies: tuple[str, ...] = ()


@dataclass(frozen=True)
class Macro:
    """Steps under a name, and the function key that plays them (empty: none)."""

    name: str
    steps: tuple[MacroStep, ...]
    key: str = ""
    note: str = ""
    page: str = FIRST_PAGE
    """The page of the key: a number or a word."""
    roles: tuple[str, ...] = ()
    """The names that stand for buses in its lines; a bus is chosen for each when it is played."""
    on_early_end: tuple[str, ...] = ()
    """The lines that run after it was stopped or failed."""
    on_early_end_moves: bool = False
    """Those lines may start motion."""
    recorded: str = ""
    """The time of the recording."""

    @property
    def parameters(self) -> tuple[MacroParameter, ...]:
        """The values that its lines take, in the order of the lines. Raises Diagnostic where they are wrong."""
        return declared(list(self._numbered()))

    @property
    def lines(self) -> tuple[str, ...]:
        return tuple(plain(step.line) for step in self.steps)

    @property
    def length(self) -> str:
        return counted(len(self.steps), "line")

    @property
    def place(self) -> str:
        """Its key, with the page unless that is the first: `F3`, `F3 (page 2)`."""
        return f"{self.key} (page {self.page})" if self.key and self.page != FIRST_PAGE else self.key

    @property
    def values(self) -> str:
        """The values and roles that it takes, in words. Raises Diagnostic where they are wrong."""
        values = f"values: {', '.join(parameter.summary for parameter in self.parameters)}" if self.parameters else ""
        roles = f"roles: {', '.join(self.roles)}" if self.roles else ""
        return "  ".join(filter(None, (values, roles)))

    @property
    def summary(self) -> str:
        """Name, key, length, values, roles and note in one line."""
        parts = [part for part in (self.length, self.values) if part]
        return f"{self.name:<16} {self.place or '-':<4} {'  '.join(parts)}  {self.note}".rstrip()

    def where(self, number: int) -> str:
        """The place of a step, counted from 1, for a message."""
        return f"macro {self.name}, step {number}"

    def _numbered(self) -> Iterator[tuple[str, str]]:
        yield from ((self.where(number), step.line) for number, step in enumerate(self.steps, 1))
        yield from (
            (f"macro {self.name}, on_early_end {number}", line) for number, line in enumerate(self.on_early_end, 1)
        )


def checked_values(macro: Macro, given: Mapping[str, str]) -> dict[str, str]:
    """The text of each value of a macro: of those given, else of the default.

    Raises Diagnostic for a value that no line takes, that is wrong or missing, or with which a line would be another
    one's: nothing may begin a verb, or name a drive, but the line itself.
    """
    parameters = {parameter.name: parameter for parameter in macro.parameters}
    for name in given:
        if name not in parameters:
            hint = f"valid: {', '.join(parameters)}" if parameters else "the macro takes no values"
            raise Diagnostic(f"no line takes the value {name}", f"macro {macro.name}", hint)
    values = {}
    for name, parameter in parameters.items():
        value = parameter.take(given[name], f"macro {macro.name}") if name in given else parameter.default
        if value is None:
            where = next(place for place, line in macro._numbered() if name in value_names(plain(line)))
            kind = "" if parameter.kind == "text" else f" ({parameter.valid})"
            raise Diagnostic(f"no value for {{{name}}}", where, f"set {name}=VALUE{kind}, or write {{{{ for a brace")
        values[name] = written(value)
    for where, line in macro._numbered():
        text, begins = fill(plain(line), _with_own(line, values), where).lstrip(), _PLACE.match(line.lstrip())
        if begins is not None and begins["name"] is not None and text.startswith(("/", "@")):
            raise Diagnostic(f"a value begins the line with {text[0]}", where, "valid: text for the drive only")
    return values


def filled(macro: Macro, given: Mapping[str, str]) -> tuple[str, ...]:
    """The lines of a macro's steps with their values. Raises Diagnostic as `checked_values` does."""
    values = checked_values(macro, given)
    return tuple(fill(line, _with_own(line, values)) for line in macro.lines)


def missing(macro: Macro, given: Mapping[str, str]) -> list[MacroParameter]:
    return [parameter for parameter in macro.parameters if parameter.default is None and parameter.name not in given]


def _with_own(line: str, values: Mapping[str, str]) -> dict[str, str]:
    """The values, and those of the macro's own `/set` lines, which stay as they are."""
    return {**{name: f"{{{name}}}" for name in value_names(plain(line))}, **values}


def check_name(name: str, where: str = "") -> None:
    """Raise Diagnostic unless `name` is valid for a macro and its file."""
    if not NAME.fullmatch(name):
        hint = "use up to 64 letters, digits, - and _, the first of them no -"
        raise Diagnostic(f"invalid macro name {name!r}", where, hint)
    if sys.platform == "win32" and reserved(name):
        raise Diagnostic(f"Windows takes {name} for a device", where, "use another name")


def check(macro: Macro, where: str = "", at: At | None = None) -> None:
    """Raise Diagnostic for a macro that cannot be stored or played. `at` finds the places of its keys."""
    at = at or (lambda key, step: where)
    check_name(macro.name, at("name", 0))
    if macro.key and macro.key not in KEYS:
        raise Diagnostic(f"invalid key {macro.key!r}", at("key", 0), 'use F2 to F12, or key = ""')
    if not _PAGE.fullmatch(macro.page):
        hint = "use a number, or up to 16 letters, digits, - and _"
        raise Diagnostic(f"invalid page {macro.page!r}", at("page", 0), hint)
    _check_text(macro.note, "note", at("note", 0))
    for role in macro.roles:
        if not is_role(role):
            raise Diagnostic(f"invalid role {role!r}", at("roles", 0), "use letters, digits, - and _")
    if len(set(macro.roles)) < len(macro.roles):
        raise Diagnostic("a role is named twice", at("roles", 0), "name each role once")
    if not macro.steps:
        raise Diagnostic("a macro without steps", where, 'add a [[step]] with after = 0.0 and line = "..."')
    for number, step in enumerate(macro.steps, 1):
        if not math.isfinite(step.after) or step.after < 0:
            what = f"step {number}: invalid after = {step.after}"
            raise Diagnostic(what, at("after", number), "valid: 0.0 s or more")
        _check_line(step.line, f"step {number}", at("line", number))
        for text in (step.drive, *step.replies):
            _check_text(text, f"step {number}: what was recorded", at("replies", number))
    for number, line in enumerate(macro.on_early_end, 1):
        _check_line(line, f"on_early_end {number}", at("on_early_end", 0))
    try:
        names = {parameter.name for parameter in macro.parameters}
    except Diagnostic as problem:  # a step is named by its number, as the lines count
        place = problem.where.partition(", ")[2]
        step_number = re.match(r"step (\d+)", place)
        place_of = at("line", int(step_number[1])) if step_number else at("on_early_end", 0)
        raise Diagnostic(f"{place}: {problem.message}", place_of, problem.hint) from None
    if both := sorted(names & set(macro.roles)):
        raise Diagnostic(f"{both[0]} is a role and a value", at("roles", 0), "give one of them another name")


def is_role(name: str) -> bool:
    return _ROLE.fullmatch(name) is not None


def _check_line(line: str, which: str, where: str) -> None:
    _check_text(line, f"{which}: line", where)
    if "\n" in line or "\r" in line:
        raise Diagnostic(f"{which}: more than one line of text", where, "give each line a [[step]]")


def _check_text(text: str, what: str, where: str) -> None:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        what = f"{what}: half a character at position {error.start + 1}"
        raise Diagnostic(what, where, "type the line again") from None


def page_order(page: str) -> tuple[bool, int, str]:
    """The order of pages: numbers first."""
    return (not page.isdecimal(), int(page) if page.isdecimal() else 0, page)


def describe_clash(key: str, names: Sequence[str]) -> str:
    """Describe the clash on a key with several macros, in one line."""
    return f"{' and '.join(names)} are {'both' if len(names) == 2 else 'all'} on {key}, which plays none of them"
