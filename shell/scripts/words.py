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
from multidrop.shell import waits
from multidrop.shell.line_syntax import ENDS, divided, split
from multidrop.shell.operations.table import SCRIPT_WORDS, VERBS
from multidrop.shell.operations.verb import Verb
from multidrop.shell.scripts.expression import Comparison, Expression, Name, Value, parse, parse_check, quoted, unknowns

T = TypeVar("T", bound=Expression)
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
OUTCOME = "outcome"
"""The name that a `/wait ended` sets."""
MOST = 10**9
"""The largest number of repetitions."""
SECONDS = 1.0
"""The default time in which `/expect` looks for its text, s."""


def wrong(word: str, message: str = "") -> Diagnostic:
    """A Diagnostic with the usage of a verb."""
    usage = f"usage: {SCRIPT_WORDS[word]}"
    return Diagnostic(message, word, usage) if message else Diagnostic(usage, word)


def rest_of(text: str) -> str:
    """The line after its verb."""
    return divided(text.strip(ENDS))[1]


def expression(text: str, names: Collection[str]) -> Expression:
    """Parse the expression of `/if`, `/repeat`, `/while` and `/until`."""
    return _parsed(text, rest_of(text), names, parse)


def check(text: str, names: Collection[str]) -> Comparison:
    """Parse `/assert` and `/verify`."""
    return _parsed(text, rest_of(text), names, parse_check)


def setting(text: str, names: Collection[str]) -> tuple[str, Expression]:
    """Parse `/set`: the name, and its expression."""
    name, rest = divided(rest_of(text))
    if not NAME.fullmatch(name):
        raise wrong("/set", f"invalid name {name}" if name else "")
    if _is_word(name):
        raise wrong("/set", f"{name} is a word of drives; use another name, or small letters")
    return name, _parsed(text, rest.strip(), names, parse)


def expectation(text: str) -> tuple[str, float]:
    """Parse `/expect`: the text, and the seconds in which it is expected."""
    words = split(rest_of(text), "/expect")
    if not (1 <= len(words) <= 2 and words[0]):
        raise wrong("/expect")
    return words[0], waits.seconds(words[1], lambda why: wrong("/expect", why)) if len(words) == 2 else SECONDS


def call(text: str) -> tuple[str, dict[str, str]]:
    """Parse `/call`: the file or macro, and the values that are given to it."""
    target, *pairs = split(rest_of(text), "/call") or [""]
    if not target:
        raise wrong("/call")
    values = {}
    for pair in pairs:
        name, sign, value = pair.partition("=")
        if not (name and sign):
            raise wrong("/call", f"no value {pair}; valid: NAME=VALUE")
        if name in values:
            raise wrong("/call", f"{name} is given twice")
        values[name] = value
    return target, values


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
    found = chosen.values
    return PlayCall(found["macro"], dict(found["values"]), found["times"], found["fast"])


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
    if isinstance(value, str) or value != int(value) or not 0 <= value <= MOST:
        raise wrong("/repeat", f"no number of repetitions {quoted(value)}; valid: 0 to {MOST}")
    return int(value)


def alone(text: str) -> None:
    """Check that `/else` or `/end` is alone on its line."""
    if rest_of(text):
        raise wrong(text.split(maxsplit=1)[0])


def _parsed(text: str, rest: str, names: Collection[str], parsing: Callable[[str, Collection[str]], T]) -> T:
    word = text.split(maxsplit=1)[0]
    if not rest:
        raise wrong(word)
    try:
        found = parsing(rest, names)
    except Diagnostic as problem:
        raise Diagnostic(problem.message, word, problem.hint) from None
    for each in unknowns(found):
        if isinstance(each, Name) and _is_word(each.name):
            hint = f"write {{{each.name}}} for the value, or choose another name"
            raise Diagnostic(f"{each.name} is a value of --set and a word of drives", word, hint)
    return found


@cache
def sets_outcome(text: str) -> bool:
    """True for a `/wait ended`."""
    return text.split()[:2] == ["/wait", "ended"]


def _is_word(name: str) -> bool:
    """True if a name in capitals is a word of a family; then it is not clear what is meant."""
    return name == name.upper() and any(family.language.knows(name) for family in FAMILIES.values())
