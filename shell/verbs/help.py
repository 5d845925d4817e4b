"""The verb that explains verbs, commands and error numbers."""

from __future__ import annotations

import difflib

from multidrop.dialects import Diagnostic
from multidrop.dialects.families import DEFAULT, FAMILIES, languages
from multidrop.dialects.family import Language
from multidrop.shell.verbs.registry import VERBS, Call, verb

WIDTH = 28
"""Columns for usages in the overview."""


@verb("/help [WORD|NUMBER]", immediate=True)
async def help_(call: Call) -> None:
    """Explain a verb, a command of the drives or an error number.

    Without a word it lists all verbs. A line without a slash goes to the selected drive, `@ADDR TEXT` to another
    drive, `@* TEXT` to all drives of a bus.
    """
    words = call.words(0, 1)
    selected = call.workspace.selected
    language, product = (selected.family.language, selected.product) if selected else (FAMILIES[DEFAULT].language, "")
    if words and words[0].isdecimal() and words[0].isascii():
        lines = error_described(words[0], language, product)
    else:
        lines = described(words[0], language, product) if words else overview()
    for line in lines:
        call.workspace.output(line, columns=True)


def overview() -> list[str]:
    """All verbs, a line each; a long usage has a line of its own."""
    lines = []
    for each in VERBS.values():
        if len(each.usage) > WIDTH:
            lines.append(each.usage)
        lines.append(f"{each.usage if len(each.usage) <= WIDTH else '':<{WIDTH}}  {each.meaning}")
    return lines


def error_described(number: str, language: Language, product: str) -> list[str]:
    """The meaning of a drive's error number. Raises Diagnostic for an unknown number."""
    return language.describe_error(int(number[:9]), product)


def described(name: str, language: Language | None = None, product: str = "") -> list[str]:
    """The help on a verb (with or without its slash) or a command, for a product where that matters.

    The selected drive's language (None: the default one) comes before others. Raises Diagnostic for an unknown name.
    """
    language = language or FAMILIES[DEFAULT].language
    if name.startswith("/") and name in VERBS:
        return VERBS[name].described()
    for each in (language, *languages()):
        if each.knows(name):
            return each.describe(name, product if each is language else "")
    if f"/{name}" in VERBS:
        return described(f"/{name}")
    near = difflib.get_close_matches(name.upper(), [*language.names(), *(key.upper() for key in VERBS)], 3)
    shown = [each.lower() if name.startswith("/") else each for each in near]
    hint = f"similar: {', '.join(shown)}" if shown else "/help lists the verbs"
    raise Diagnostic(f"no verb or command {name}", "/help", hint)
