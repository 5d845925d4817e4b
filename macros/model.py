"""A macro: lines as typed, with the seconds between them; and the rules for its parts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from multidrop.dialects.errors import Diagnostic
from multidrop.macros.braces import fill, value_names
from multidrop.macros.parameters import Parameter, begins_with_value, declared, plain, written
from multidrop.macros.places import At, nowhere

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")
KEYS = tuple(f"F{number}" for number in range(2, 13))
"""The keys that can play a macro."""
FIRST_PAGE = "1"
"""The default page of a key."""
_PAGE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,15}")
_ROLE = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True)
class Step:
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
    steps: tuple[Step, ...]
    key: str = ""
    note: str = ""
    page: str = FIRST_PAGE
    """The page of the key: a number or a word."""
    roles: tuple[str, ...] = ()
    """The names that stand for buses in its lines; a bus is chosen for each when it is played."""
    on_stop: tuple[str, ...] = ()
    """The lines that run after it was stopped or failed."""
    on_stop_moves: bool = False
    """Those lines may start motion."""
    recorded: str = ""
    """The time of the recording."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The values that its lines take, in the order of the lines. Raises Diagnostic where they are wrong."""
        return declared(list(self._numbered()))

    @property
    def lines(self) -> tuple[str, ...]:
        """The lines of its steps, with `{NAME}` for each value."""
        return tuple(plain(step.line) for step in self.steps)

    @property
    def length(self) -> str:
        """The number of its lines, in words."""
        return f"{len(self.steps)} {'line' if len(self.steps) == 1 else 'lines'}"

    @property
    def place(self) -> str:
        """Its key, with the page unless that is the first: `F3`, `F3 (page 2)`."""
        return f"{self.key} (page {self.page})" if self.key and self.page != FIRST_PAGE else self.key

    @property
    def values(self) -> str:
        """The values and roles that it takes, in words. Raises Diagnostic where they are wrong."""
        values = f"values: {', '.join(each.summary for each in self.parameters)}" if self.parameters else ""
        roles = f"roles: {', '.join(self.roles)}" if self.roles else ""
        return "  ".join(filter(None, (values, roles)))

    @property
    def summary(self) -> str:
        """Name, key, length, values, roles and note in one line."""
        parts = [each for each in (self.length, self.values) if each]
        return f"{self.name:<16} {self.place or '-':<4} {'  '.join(parts)}  {self.note}".rstrip()

    def where(self, number: int) -> str:
        """The place of a step, counted from 1, for a message."""
        return f"macro {self.name}, step {number}"

    def _numbered(self) -> Iterator[tuple[str, str]]:
        """Every line with its place, those for a stop last."""
        yield from ((self.where(number), step.line) for number, step in enumerate(self.steps, 1))
        yield from ((self._on_stop(number), line) for number, line in enumerate(self.on_stop, 1))

    def _on_stop(self, number: int) -> str:
        return f"macro {self.name}, on_stop {number}"


def checked_values(macro: Macro, given: Mapping[str, str]) -> dict[str, str]:
    """The text of each value of a macro: of those given, else of the default.

    Raises Diagnostic for a value that no line takes, that is wrong or missing, or with which a line would be another
    one's: nothing may begin a verb, or name a drive, but the line itself.
    """
    parameters = {each.name: each for each in macro.parameters}
    for name in given:
        if name not in parameters:
            hint = f"valid: {', '.join(parameters)}" if parameters else "the macro takes no values"
            raise Diagnostic(f"no line takes the value {name}", f"macro {macro.name}", hint)
    values = {}
    for name, each in parameters.items():
        value = each.take(given[name], f"macro {macro.name}") if name in given else each.default
        if value is None:
            raise _missing(macro, each)
        values[name] = written(value)
    for where, line in macro._numbered():
        _check_head(line, fill(plain(line), _with_own(line, values), where), where)
    return values


def filled(macro: Macro, given: Mapping[str, str]) -> tuple[str, ...]:
    """The lines of a macro's steps with their values. Raises Diagnostic as `checked_values` does."""
    values = checked_values(macro, given)
    return tuple(fill(line, _with_own(line, values), macro.where(n)) for n, line in enumerate(macro.lines, 1))


def missing(macro: Macro, given: Mapping[str, str]) -> list[Parameter]:
    """The values that have to be given and are not."""
    return [each for each in macro.parameters if each.default is None and each.name not in given]


def _with_own(line: str, values: Mapping[str, str]) -> dict[str, str]:
    """The values, and those of the macro's own `/set` lines, which stay as they are."""
    return {**{name: f"{{{name}}}" for name in value_names(plain(line))}, **values}


def _missing(macro: Macro, parameter: Parameter) -> Diagnostic:
    where = next(place for place, line in macro._numbered() if parameter.name in value_names(plain(line)))
    kind = "" if parameter.kind == "text" else f" ({parameter.valid})"
    hint = f"set {parameter.name}=VALUE{kind}, or write {{{{ for a brace"
    return Diagnostic(f"no value for {{{parameter.name}}}", where, hint)


def _check_head(line: str, filled: str, where: str) -> None:
    if begins_with_value(line) and filled.lstrip().startswith(("/", "@")):
        raise Diagnostic(f"a value begins the line with {filled.lstrip()[0]}", where, "valid: text for the drive only")


def check_name(name: str, where: str = "") -> None:
    """Raise Diagnostic unless `name` is valid for a macro and its file."""
    if not NAME.fullmatch(name):
        raise Diagnostic(
            f"invalid macro name {name!r}",
            where,
            "use up to 64 letters, digits, - and _, the first of them no -",
        )


def check(macro: Macro, where: str = "", at: At | None = None) -> None:
    """Raise Diagnostic for a macro that cannot be stored or played. `at` finds the places of its keys."""
    at = at or nowhere(where)
    check_name(macro.name, at("name", 0))
    if macro.key and macro.key not in KEYS:
        raise Diagnostic(f"invalid key {macro.key!r}", at("key", 0), 'use F2 to F12, or key = ""')
    if not _PAGE.fullmatch(macro.page):
        hint = "use a number, or up to 16 letters, digits, - and _"
        raise Diagnostic(f"invalid page {macro.page!r}", at("page", 0), hint)
    _check_text(macro.note, "note", at("note", 0))
    _check_roles(macro.roles, at("roles", 0))
    if not macro.steps:
        raise Diagnostic("a macro without steps", where, 'add a [[step]] with after = 0.0 and line = "..."')
    for number, step in enumerate(macro.steps, 1):
        _check_step(step, number, at)
    for number, line in enumerate(macro.on_stop, 1):
        _check_line(line, f"on_stop {number}", at("on_stop", 0))
    _check_parameters(macro, at)


def is_role(name: str) -> bool:
    """Whether a name is valid for a role."""
    return _ROLE.fullmatch(name) is not None


def _check_roles(roles: Sequence[str], where: str) -> None:
    for role in roles:
        if not is_role(role):
            raise Diagnostic(f"invalid role {role!r}", where, "use letters, digits, - and _")
    if len(set(roles)) < len(roles):
        raise Diagnostic("a role is named twice", where, "name each role once")


def _check_step(step: Step, number: int, at: At) -> None:
    which = f"step {number}"
    if not math.isfinite(step.after) or step.after < 0:
        raise Diagnostic(f"{which}: invalid after = {step.after}", at("after", number), "valid: 0.0 s or more")
    _check_line(step.line, which, at("line", number))
    for text in (step.drive, *step.replies):
        _check_text(text, f"{which}: what was recorded", at("replies", number))


def _check_line(line: str, which: str, where: str) -> None:
    _check_text(line, f"{which}: line", where)
    if "\n" in line or "\r" in line:
        raise Diagnostic(f"{which}: more than one line of text", where, "give each line a [[step]]")


def _check_parameters(macro: Macro, at: At) -> None:
    """Check the types of values; a step is named by its number, as the lines count."""
    try:
        names = {each.name for each in declared(list(macro._numbered()))}
    except Diagnostic as problem:
        place = problem.where.partition(", ")[2]
        number = re.match(r"step (\d+)", place)
        where = at("line", int(number[1])) if number else at("on_stop", 0)
        raise Diagnostic(f"{place}: {problem.message}", where, problem.hint) from None
    if both := sorted(names & set(macro.roles)):
        raise Diagnostic(f"{both[0]} is a role and a value", at("roles", 0), "give one of them another name")


def _check_text(text: str, what: str, where: str) -> None:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise Diagnostic(
            f"{what}: half a character at position {error.start + 1}", where, "type the line again"
        ) from None


def page_order(page: str) -> tuple[bool, int, str]:
    """The order of pages: numbers first."""
    return (not page.isdecimal(), int(page) if page.isdecimal() else 0, page)


def describe_clash(key: str, names: Sequence[str]) -> str:
    """Describe the clash on a key with several macros, in one line."""
    return f"{' and '.join(names)} are {'both' if len(names) == 2 else 'all'} on {key}, which plays none of them"
