"""Help on verbs, on commands of the drives and on error numbers, in lines for a person."""

from __future__ import annotations

import difflib

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import DEFAULT, FAMILIES, languages, program_languages
from multidrop.dialects.language import Language, labelled
from multidrop.shell.operations.conditions import ON_SCREEN
from multidrop.shell.operations.table import VERBS, groups, script_verbs
from multidrop.shell.session import Session

WIDTH = 28
"""Columns for usages in the overview."""


def on(session: Session, word: str) -> list[str]:
    """Help on a word, for the selected drive where there is one; on all verbs without a word. Raises Diagnostic."""
    selected = session.selected
    language, product = (selected.family.language, selected.product) if selected else (None, "")
    lines = explained(word, language, product) if word else overview()
    if word and selected and session.scaled and selected.family.language.knows(word):
        from multidrop.shell import setting_units

        taken = setting_units.example(session.units, selected, word.upper())
        lines = [*lines, *labelled([("units", taken)])]
    return lines


def explained(word: str, language: Language | None, product: str = "") -> list[str]:
    """Return the help on a verb, a command or an error number. Raises Diagnostic for what is none."""
    if word.isdecimal() and word.isascii():
        language = language or FAMILIES[DEFAULT].language
        return language.describe_error(int(word[:9]), product)
    return described(word, language, product)


def overview() -> list[str]:
    """All verbs in their groups, a line each; a long usage has a line of its own."""
    lines: list[str] = []
    for title, names in groups().items():
        lines += ["", f"{title}:"] if lines else [f"{title}:"]
        for verb in map(VERBS.__getitem__, names):
            if len(verb.usage) > WIDTH:
                lines.append(verb.usage)
            mark = "[screen] " * (verb.fits in ON_SCREEN)
            lines.append(f"{verb.usage if len(verb.usage) <= WIDTH else '':<{WIDTH}}  {mark}{verb.lines[0]}")
    lines += ["", "In scripts only:"]
    for verb in script_verbs().values():
        lines += [verb.usage] if len(verb.usage) > WIDTH else []
        lines.append(f"{verb.usage if len(verb.usage) <= WIDTH else '':<{WIDTH}}  {verb.help}")
    return [*lines, "", "[screen]: only on the screen, which multidrop tui shows"]


def described(name: str, language: Language | None = None, product: str = "") -> list[str]:
    """Return the help on a verb (with or without its slash) or a command, for a product where that matters.

    Where a drive is selected, only its language is explained: a word may mean something else to another drive. Without
    one (None) each language is. Raises Diagnostic for an unknown name.
    """
    if name.startswith("/") and name in VERBS:
        verb = VERBS[name]
        return [*verb.described(), *["Needs the screen, which multidrop tui shows."] * (verb.fits in ON_SCREEN)]
    files = program_languages().items()
    stored = {key: lines for key, each in files if (lines := each.editing.describe(name, product))}
    also = f"/{name.lower()}"
    more = [f"also: the verb {also}; help {also} explains it"] * (also in VERBS or also in script_verbs())
    for spoken in [language] if language else languages():
        if spoken.knows(name):
            return [*spoken.describe(name, product), *more]
    for key, lines in stored.items():
        if language is FAMILIES[key].language:
            return [*lines, *more]
    if f"/{name}" in VERBS:
        return described(f"/{name}")
    word = name.lower() if name.startswith("/") else f"/{name.lower()}"
    if word in script_verbs():
        verb = script_verbs()[word]
        return [
            verb.usage,
            f"{verb.help[0].upper()}{verb.help[1:]}.",
            "In scripts only: multidrop run SCRIPT, or /play of a macro.",
        ]
    if language is None and stored:
        return [*next(iter(stored.values()))]
    if language and (
        others := [key for key, family in FAMILIES.items() if key in stored or family.language.knows(name)]
    ):
        raise Diagnostic(
            f"this drive has no command {name}", "/help", f"multidrop help {name} --dialect {others[0]} explains it"
        )
    own = language or FAMILIES[DEFAULT].language
    known = {key.removeprefix("/").upper(): key for key in (*script_verbs(), *VERBS)}
    known |= {} if name.startswith("/") else {each.upper(): each for each in own.names()}
    near = difflib.get_close_matches(name.removeprefix("/").upper(), known, 3)
    hint = f"similar: {', '.join(known[each] for each in near)}" if near else "/help lists the verbs"
    raise Diagnostic(f"no verb or command {name}", "/help", hint)
