"""The arguments of the verbs of scripts. Each function raises Diagnostic for a wrong argument."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import FAMILIES
from multidrop.macros import Macro
from multidrop.shell.line_syntax import ENDS, divided
from multidrop.shell.operations.table import VERBS, script_verbs
from multidrop.shell.operations.verb import Verb
from multidrop.shell.scripts.expression import Comparison, Expression, Name, Value, parse, parse_check, quoted, unknowns

T = TypeVar("T", bound=Expression)
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
OUTCOME = "outcome"
"""The name that a `/wait ended` sets."""
MOST_REPETITIONS = 10**9
"""The largest number of repetitions."""


def rest_of(text: str) -> str:
    """The line after its verb."""
    return divided(text.strip(ENDS))[1]


def expression(word: str, text: str, names: Collection[str]) -> Expression:
    """Parse an expression of a verb. Raises Diagnostic."""
    return _parsed(word, text, names, parse)


def comparison(word: str, text: str, names: Collection[str]) -> Comparison:
    """Parse a comparison of a verb. Raises Diagnostic."""
    return _parsed(word, text, names, parse_check)


def check_name(name: str) -> None:
    """Raise Diagnostic for a name that `/set` cannot give a value."""
    verb = script_verbs()["/set"]
    if not NAME.fullmatch(name):
        raise verb.wrong(f"invalid name {name}" if name else "")
    if _is_word(name):
        raise verb.wrong(f"{name} is a word of drives; use another name, or small letters")


def call(text: str) -> tuple[str, dict[str, str]]:
    """Parse `/call`: the file or macro, and the values that are given to it."""
    values = script_verbs()["/call"].parsed(rest_of(text)).values
    return values["target"], dict(values["values"])


def macro_call(text: str) -> PlayCall:
    """Parse `/play MACRO`, or `/call MACRO`, which has values only."""
    word = text.split(maxsplit=1)[0]
    if word == "/call":
        return PlayCall(*call(text))
    verb = VERBS["/play"]
    assert isinstance(verb, Verb)
    chosen = verb.parsed(rest_of(text))
    if chosen.form.fixed:  # it ends macros
        raise verb.wrong()
    values = chosen.values
    return PlayCall(values["macro"], dict(values["values"]), values["times"], values["fast"])


@dataclass(frozen=True)
class PlayCall:
    """The words after `/play`."""

    macro: str
    given: Mapping[str, str]
    """Values and roles."""
    times: int | None = 1
    """None: until it is ended."""
    fast: bool = False

    def divided(self, macro: Macro) -> tuple[dict[str, str], dict[str, str]]:
        """The values, and the buses of the roles."""
        roles = {name: value for name, value in self.given.items() if name in macro.roles}
        return {name: value for name, value in self.given.items() if name not in roles}, roles


def repetitions(value: Value) -> int:
    if isinstance(value, str) or value != int(value) or not 0 <= value <= MOST_REPETITIONS:
        verb = script_verbs()["/repeat"]
        raise verb.wrong(f"no number of repetitions {quoted(value)}; valid: 0 to {MOST_REPETITIONS}")
    return int(value)


def _parsed(word: str, text: str, names: Collection[str], parsing: Callable[[str, Collection[str]], T]) -> T:
    try:
        result = parsing(text, names)
    except Diagnostic as problem:
        raise Diagnostic(problem.message, word, problem.hint) from None
    for unknown in unknowns(result):
        if isinstance(unknown, Name) and _is_word(unknown.name):
            hint = f"write {{{unknown.name}}} for the value, or choose another name"
            raise Diagnostic(f"{unknown.name} is a value of --set and a word of drives", word, hint)
    return result


@cache
def sets_outcome(text: str) -> bool:
    """True for a `/wait ended`."""
    return text.split()[:2] == ["/wait", "ended"]


def _is_word(name: str) -> bool:
    """True if a name in capitals is a word of a family; then it is not clear what is meant."""
    return name == name.upper() and any(family.language.knows(name) for family in FAMILIES.values())
