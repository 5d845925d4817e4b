"""The result of a run in the terms of conditions, and the CONDITION of `--expect`: a comparison like that of `/assert`.

Lists are written in brackets, compare with `==` and `!=`, and take no part in calculations: `errors == [86]`. A number
in a list equals a print that is this number. `ended` is a text, and beside a number 1 or 0: ended by itself, or not.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.shell.scripts.expression import (
    EQUAL,
    Comparison,
    Expression,
    Known,
    Name,
    Value,
    Word,
    compared,
    evaluate,
    number,
    parse_check,
    quoted,
    unknowns,
    value_of,
)
from multidrop.simulator.program_run import Event

BY_ITSELF = ("E", "END")
"""The ends of a program that has ended by itself."""
ENDS = (*BY_ITSELF, "error", "until")
Position = int | tuple[int, ...]


class Outcome(NamedTuple):
    """`position` has a number for each axis, `errors` those that the program did not handle, in their order."""

    position: Position = 0
    errors: tuple[int | str, ...] = ()
    prints: tuple[str, ...] = ()
    virtual_s: float = 0.0
    ended: str = "E"


def outcome_of(events: Iterable[Event]) -> Outcome:
    """Run to the end, and take the result from the events."""
    prints: list[str] = []
    fact = {}
    for event in events:
        fact = event.fact(0.0)
        if "print" in fact:
            prints.append(fact["print"])
    summary = fact["summary"]
    place = summary["position"]
    return Outcome(
        position=tuple(place.values()) if isinstance(place, dict) else place,
        errors=tuple(summary["errors"]),
        prints=tuple(prints),
        virtual_s=summary["virtual_s"],
        ended=summary["ended"],
    )


NAMES = Outcome._fields
LISTS = ("errors", "prints")
POSITION, ENDED = "position", "ended"
List = tuple[Value, ...]
Side = Value | List
_SINGLE = re.compile(r"\"[^\"]*\"|'([^'\"]*)'")
_ITEMS = re.compile(r"\s*(?:\"([^\"]*)\"|'([^']*)'|([^,\"'\[\]]+?))\s*(?:,|$)")


@dataclass(frozen=True)
class Condition:
    """One comparison. `text` is what was written."""

    text: str
    tree: Comparison

    def holds(self, outcome: Outcome) -> bool:
        """Whether the condition holds for a result. Raises Diagnostic for a calculation without a value."""
        names = [each for each in unknowns(self.tree) if isinstance(each, Name)]
        values = {each: getattr(outcome, each.name, each.name) for each in names}
        known: Known = {each: "" if isinstance(value, tuple) else value for each, value in values.items()}
        left, right = (_side(each, outcome, known) for each in (self.tree.left, self.tree.right))
        if not (isinstance(left, tuple) or isinstance(right, tuple)):
            left, right = _beside(self.tree, left, right)
        return _compared(self.tree.sign, left, right, number(evaluate(self.tree.within, known)))

    def seen(self, outcome: Outcome) -> str:
        found = (each.name for each in unknowns(self.tree) if isinstance(each, Name))
        values = {each: getattr(outcome, each) for each in found if each in NAMES}
        shown = {
            name: f"[{', '.join(map(quoted, value))}]" if isinstance(value, tuple) else quoted(value)
            for name, value in values.items()
        }
        return ", ".join(f"{name} == {value}" for name, value in shown.items())


def parse(text: str, example: Outcome) -> Condition:
    """Parse a condition; `example` is a result of the family's programs. Raises Diagnostic."""
    try:
        quoted_twice = _SINGLE.sub(lambda match: match[0] if match[1] is None else f'"{match[1]}"', text)
        tree = parse_check(quoted_twice, (*NAMES, *ENDS), lists=True)
    except Diagnostic as problem:
        raise Diagnostic(problem.message, f"--expect {text}", problem.hint.replace("[@ADDR] ", "")) from None
    found = tuple(unknowns(tree))
    for each in found:
        if isinstance(each, Word) and (each.target or not each.line):
            raise Diagnostic(f"{each.shown} is not a result", f"--expect {text}", f"valid: {', '.join(NAMES)}")
    if not any(isinstance(each, Name) and each.name in NAMES for each in found):
        raise Diagnostic("is not about a result", f"--expect {text}", f"valid: {', '.join(NAMES)}")
    _check_lists(text, tree, example)
    return Condition(text, tree)


def _check_lists(text: str, tree: Comparison, example: Outcome) -> None:
    """Refuse a list in a calculation, beside a number, or in an order. Raises Diagnostic."""
    sides = [_is_list(each, example) for each in (tree.left, tree.right)]
    no_lists = [tree.within, *(each for each in (tree.left, tree.right) if not _is_list(each, example))]
    inner = [each for part in no_lists for each in unknowns(part) if _is_list(each, example)]
    mixed, ordered = any(sides) != all(sides), any(sides) and tree.sign not in EQUAL
    if inner or mixed or ordered:
        hint = 'as in errors == [], errors == [86], prints == ["done"]'
        raise Diagnostic("compares a list, which has == and != with a list only", f"--expect {text}", hint)
    for each in unknowns(tree):
        if isinstance(each, Word):
            _items(each.text)


def _is_list(tree: Expression, example: Outcome) -> bool:
    if isinstance(tree, Name):
        return isinstance(getattr(example, tree.name, None), tuple)
    return isinstance(tree, Word)


def _side(tree: Expression, outcome: Outcome, known: Known) -> Side:
    if isinstance(tree, Word):
        return _items(tree.text)
    if isinstance(tree, Name):
        value: Side = getattr(outcome, tree.name, tree.name)
        return value
    return evaluate(tree, known)


def _beside(tree: Comparison, left: Value, right: Value) -> tuple[Value, Value]:
    """The two sides; `ended` beside a number is one, too."""
    if tree.left == Name(ENDED) and not isinstance(right, str):
        return int(left in BY_ITSELF), right
    if tree.right == Name(ENDED) and not isinstance(left, str):
        return left, int(right in BY_ITSELF)
    return left, right


def _compared(sign: str, left: Side, right: Side, within: float) -> bool:
    if isinstance(left, tuple) and isinstance(right, tuple):
        pairs = zip(left, right, strict=False)
        equal = len(left) == len(right) and all(_alike(*pair, within) for pair in pairs)
        return equal == (sign == "==")
    assert not isinstance(left, tuple) and not isinstance(right, tuple)
    return compared(sign, left, right, within)


def _alike(left: Value, right: Value, within: float) -> bool:
    if isinstance(left, str) != isinstance(right, str):
        left, right = (value_of(each) if isinstance(each, str) else each for each in (left, right))
    return compared("==", left, right, within)


def _items(text: str) -> List:
    found: list[Value] = []
    at = 0
    while at < len(text):
        match = _ITEMS.match(text, at)
        if match is None:
            raise Diagnostic(f"[{text}] is not a list", hint='as in [], [86], ["done", "at 51200"]')
        double, single, bare = match.groups()
        found.append(value_of(bare) if bare is not None else double if double is not None else single)
        at = match.end()
    return tuple(found)
