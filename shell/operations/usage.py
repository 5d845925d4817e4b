"""The notation of a verb's usage: one line that help shows, error messages quote and completion follows.

`[X]` is optional, `A|B` is one word or the other, ` | ` separates whole forms, `X ...` may repeat. A word with capitals
is a placeholder, any other word is literal: `/wait stopped|idle [SECONDS]`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf


@dataclass(frozen=True)
class Place:
    """The place of one word: its choices, and whether it may repeat."""

    words: tuple[str, ...]
    repeats: bool = False

    def takes(self, word: str) -> bool:
        return word in self.words or (not word.startswith("--") and any(map(is_placeholder, self.words)))


Form = tuple[Place, ...]


def is_placeholder(word: str) -> bool:
    return not word.startswith("--") and word != word.lower()


@lru_cache
def forms(usage: str) -> list[Form]:
    """Every form of a verb's line, without the verb's name."""
    return list(_alternatives(usage.partition(" ")[2]))


def following(usage: str, typed: Sequence[str]) -> list[str]:
    """The literals and placeholders that may follow these words, each once."""
    at = {(form, 0) for form in forms(usage)}
    for word in typed:
        here = {(form, n) for form, n in at if n < len(form) and form[n].takes(word)}
        here = {(form, n) for form, n in here if word in form[n].words} or here  # a literal takes precedence
        at = {(form, n + 1) for form, n in here} | {(form, n) for form, n in here if form[n].repeats}
    return list(
        dict.fromkeys(
            word for form in forms(usage) for n in range(len(form)) if (form, n) in at for word in form[n].words
        )
    )


def narrowed(usage: str, typed: Sequence[str]) -> str:
    """The usage with only the forms that begin with these words (the last one may be unfinished); else all of it."""
    name, _, rest = usage.partition(" ")
    fitting = [part for part in _parts(rest) if any(_fits(form, typed) for form in _sequence(_items(part)))]
    if typed and not is_placeholder(typed[0]):
        begun = [[form[0].words for form in _sequence(_items(part)) if form] for part in fitting]
        fitting = [part for part, first in zip(fitting, begun, strict=True) if typed[0] in sum(first, ())] or fitting
    return f"{name} {' | '.join(fitting)}" if fitting else usage


def _fits(form: Form, typed: Sequence[str]) -> bool:
    if not typed or len(form) < len(typed):
        return not typed
    *whole, last = typed
    place = form[len(whole)]
    begun = place.takes(last) or any(word.startswith(last) for word in place.words)
    return begun and all(before.takes(word) for before, word in zip(form, whole, strict=False))


def _alternatives(text: str) -> Iterator[Form]:
    for part in _parts(text):
        yield from _sequence(_items(part))


def _parts(text: str) -> list[str]:
    """The parts between bars with blanks around them."""
    parts: list[list[str]] = [[]]
    for item in _items(text):
        if item == "|":
            parts.append([])
        else:
            parts[-1].append(item)
    return [" ".join(part) for part in parts]


def _sequence(items: Sequence[str]) -> list[Form]:
    """The forms of a sequence of words."""
    found: list[Form] = [()]
    for item in items:
        if item == "...":
            found = [(*form[:-1], replace(form[-1], repeats=True)) for form in found]
        elif _is_group(item):
            inner: list[Form] = [(), *_alternatives(item[1:-1])]
            found = [(*form, *more) for form in found for more in inner]
        else:
            found = [(*form, Place(tuple(item.split("|")))) for form in found]
    return list(dict.fromkeys(found))


def _items(text: str) -> list[str]:
    """The words of a usage; brackets keep words together."""
    items, depth = [""], 0
    for character in text:
        depth += (character == "[") - (character == "]")
        if character == " " and not depth:
            items.append("")
        else:
            items[-1] += character
    return [item for item in items if item]


def _is_group(item: str) -> bool:
    """True if brackets go around the whole: `[X]`, not `[HOST:]PORT`."""
    depths = [item[: n + 1].count("[") - item[: n + 1].count("]") for n in range(len(item))]
    return item[0] == "[" and 0 not in depths[:-1]


@lru_cache
def limits(usage: str) -> tuple[int, float]:
    """The least and the largest number of words after the verb's name."""
    lengths = [inf if any(place.repeats for place in form) else len(form) for form in forms(usage)]
    return min(len(form) for form in forms(usage)), max(lengths)
