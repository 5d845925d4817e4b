"""Completion and hints for the line being typed, at the prompt and in the TUI."""

from __future__ import annotations

import re
from dataclasses import dataclass

from multidrop.dialects import Diagnostic
from multidrop.drives.drive import Drive
from multidrop.shell.line_syntax import EVERYONE, DriveLine, VerbLine, parse
from multidrop.shell.operations.offers import PLACEHOLDERS, Found, meant, offered, spoken, targets, verbs
from multidrop.shell.operations.table import VERBS
from multidrop.shell.operations.usage import following, narrowed
from multidrop.shell.workspace import Workspace

MOST = 200
"""The largest number of completions."""


@dataclass(frozen=True)
class Completion:
    """A replacement of the text from column `start` to its end, with its meaning in one line."""

    text: str
    meaning: str
    start: int


def complete(workspace: Workspace, text: str) -> list[Completion]:
    head, word = _last_word(text)
    start = len(text) - len(word)
    if not head.strip() and word.startswith("/"):
        found: Found = verbs(workspace)
    elif head.lstrip().startswith("/"):
        found = _arguments(workspace, head.split(), word)
    elif not head.strip() and word.startswith("@"):
        found = ((f"@{target} ", meaning) for target, meaning in targets(workspace))
    else:
        # The labels and variables of the drive that may end a line, then the words of its language.
        try:
            line = parse(text)
        except Diagnostic:
            return []
        if not isinstance(line, DriveLine):
            return []
        language, product = spoken(workspace, line)
        typed = line.text + text[len(text.rstrip()) :]
        word = language.typing(typed)
        if not text.endswith(word):
            return []
        start = len(text) - len(word)
        drive = names_of(workspace, text)
        named = workspace.names.offered(drive, typed) if drive is not None else ()
        words = language.complete(word, product) if word else ()
        return [Completion(name, meaning, start) for name, meaning in [*named, *words][:MOST]]
    folded = word.lower()
    fitting = dict(
        (each, Completion(each, meaning, start)) for each, meaning in found if each.lower().startswith(folded)
    )
    return list(fitting.values())[:MOST]


def hint(workspace: Workspace, text: str) -> str:
    """Usage and meaning of the line being typed, in one line; empty where neither is known."""
    try:
        parsed = parse(text)
    except Diagnostic:
        return "@ADDR TEXT goes to one drive, @* TEXT to all drives of the bus"
    if isinstance(parsed, VerbLine):
        verb = VERBS.get(parsed.name)
        typed = parsed.rest.split()
        return f"{narrowed(verb.usage, typed)}   {verb.meaning_of(typed)}" if verb else ""
    if parsed is None:
        return ""
    language, product = spoken(workspace, parsed)
    return language.hint(parsed.text, product)


def _last_word(text: str) -> tuple[str, str]:
    found = re.search(r"\S*$", text)
    word = found.group() if found else ""
    return text[: len(text) - len(word)], word


def names_of(workspace: Workspace, text: str) -> Drive | None:
    """The drive whose labels and variables may end the typed text; None where none may."""
    try:
        line = parse(text)
    except Diagnostic:
        return None
    return meant(workspace, line) if isinstance(line, DriveLine) and line.address not in EVERYONE else None


def _arguments(workspace: Workspace, typed: list[str], word: str) -> Found:
    """The completions that a verb's usage allows here."""
    verb = VERBS.get(typed[0])
    for each in following(verb.usage, typed[1:]) if verb else ():
        if each in PLACEHOLDERS:
            yield from offered(workspace, each, word)
        elif each == each.lower():
            yield each, verb.words.get(each, "") if verb else ""
