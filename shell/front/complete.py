"""Completion and hints for a line that is being typed, for the prompt and the TUI alike."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dialects import Diagnostic
from shell.lines import DriveLine, VerbLine, parse
from shell.verbs.commands import VERBS
from shell.verbs.offers import PLACEHOLDERS, Found, spoken, targets, verbs
from shell.verbs.usage import following, narrowed

if TYPE_CHECKING:
    from shell.session import Session

MOST = 200
"""Completions given at most."""


@dataclass(frozen=True)
class Completion:
    """What may stand from column `start` to the end of the text, and what it means, in one line."""

    text: str
    meaning: str
    start: int


def complete(session: Session, text: str) -> list[Completion]:
    """What the last word of the text may become."""
    head, word = _last_word(text)
    start = len(text) - len(word)
    if not head.strip() and word.startswith("/"):
        found: Found = verbs(session)
    elif head.lstrip().startswith("/"):
        found = _arguments(session, head.split(), word)
    elif not head.strip() and word.startswith("@"):
        found = ((f"@{target} ", meaning) for target, meaning in targets(session))
    else:
        return _mnemonics(session, text)
    folded = word.lower()
    fitting = dict(
        (each, Completion(each, meaning, start)) for each, meaning in found if each.lower().startswith(folded)
    )
    return list(fitting.values())[:MOST]


def hint(session: Session, text: str) -> str:
    """Usage and meaning of what is being typed, in one line; empty where there is nothing to say."""
    try:
        parsed = parse(text)
    except Diagnostic:
        return "@ADDR TEXT goes to one drive, @* TEXT to all of the bus"
    if isinstance(parsed, VerbLine):
        verb = VERBS.get(parsed.name)
        typed = parsed.rest.split()
        return f"{narrowed(verb.usage, typed)}   {verb.meaning_of(typed)}" if verb else ""
    if parsed is None:
        return ""
    language, product = spoken(session, parsed)
    return language.hint(parsed.text, product)


def _last_word(text: str) -> tuple[str, str]:
    found = re.search(r"\S*$", text)
    word = found.group() if found else ""
    return text[: len(text) - len(word)], word


def _mnemonics(session: Session, text: str) -> list[Completion]:
    try:
        line = parse(text)
    except Diagnostic:
        return []
    if not isinstance(line, DriveLine):
        return []
    language, product = spoken(session, line)
    word = language.typing(line.text)
    if not word or not text.endswith(word):
        return []
    start = len(text) - len(word)
    return [Completion(name, meaning, start) for name, meaning in language.complete(word, product)[:MOST]]


def _arguments(session: Session, typed: list[str], word: str) -> Found:
    """What a verb's usage has at this place."""
    verb = VERBS.get(typed[0])
    for each in following(verb.usage, typed[1:]) if verb else ():
        if each in PLACEHOLDERS:
            yield from PLACEHOLDERS[each](session, word)
        elif each == each.lower():
            yield each, verb.words.get(each, "") if verb else ""
