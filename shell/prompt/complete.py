"""Completion and hints for the line being typed, at the prompt and in the TUI.

The values of an argument are open buses and drives, files, words of the drives' languages.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import DEFAULT, FAMILIES
from multidrop.drives.drive import Drive
from multidrop.macros import KEYS
from multidrop.shell.connect.schemes import schemes
from multidrop.shell.line_syntax import EVERYONE, DriveLine, VerbLine, join_target, parse
from multidrop.shell.operations.conditions import simulated_cell
from multidrop.shell.operations.parameter import Listed, Parameter
from multidrop.shell.operations.table import VERBS
from multidrop.shell.workspace import Workspace
from multidrop.simulator.declared import simulated
from multidrop.simulator.families import PROGRAMS

if TYPE_CHECKING:
    from multidrop.dialects.language import Language

MOST_COMPLETIONS = 200
"""The largest number of completions."""
Found = Iterable[tuple[str, str]]
"""Texts, each with its meaning."""


@dataclass(frozen=True)
class Completion:
    """A replacement of the text from column `start` to its end, with its meaning in one line."""

    text: str
    meaning: str
    start: int


def complete(workspace: Workspace, text: str) -> list[Completion]:
    begun = re.search(r"\S*$", text)
    word = begun.group() if begun else ""
    start = len(text) - len(word)
    head = text[:start]
    if not head.strip() and word.startswith("/"):
        candidates: Found = verbs(workspace)
    elif head.lstrip().startswith("/"):
        candidates = _arguments(workspace, head.split(), word)
    elif not head.strip() and word.startswith("@"):
        candidates = ((f"@{target} ", meaning) for target, meaning in targets(workspace))
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
        return [Completion(name, meaning, start) for name, meaning in [*named, *words][:MOST_COMPLETIONS]]
    folded = word.lower()
    fitting = dict(
        (name, Completion(name, meaning, start)) for name, meaning in candidates if name.lower().startswith(folded)
    )
    return list(fitting.values())[:MOST_COMPLETIONS]


def hint(workspace: Workspace, text: str) -> str:
    """Usage and meaning of the line being typed, in one line; empty where neither is known."""
    try:
        parsed = parse(text)
    except Diagnostic:
        return "@ADDR TEXT goes to one drive, @* TEXT to all drives of the bus"
    if isinstance(parsed, VerbLine):
        verb = VERBS.get(parsed.name)
        typed = parsed.rest.split()
        return f"{verb.narrowed(typed)}   {verb.meaning_of(typed)}" if verb else ""
    if parsed is None:
        return ""
    language, product = spoken(workspace, parsed)
    return language.hint(parsed.text, product)


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
    for parameter in verb.following(typed[1:]) if verb is not None else ():
        if isinstance(parameter, Parameter):
            for listed in parameter.argument.listed:
                yield from offered(workspace, listed, word)
        else:
            yield parameter


def spoken(workspace: Workspace, line: DriveLine) -> tuple[Language, str]:
    """Language and product of the drive that a line goes to, or of a neighbour if that drive is not known."""
    drive = meant(workspace, line)
    if drive is None and (bus := workspace.buses.get(line.bus or workspace.selected_bus)):
        drive = next(iter(bus.drives.values()), None)
    return (drive.family.language, drive.product) if drive else (FAMILIES[DEFAULT].language, "")


def meant(workspace: Workspace, line: DriveLine) -> Drive | None:
    bus = workspace.buses.get(line.bus or workspace.selected_bus)
    if not bus or not (line.bus or line.address):
        return workspace.selected
    return bus.drives.get(line.address or "")


def targets(workspace: Workspace) -> Found:
    """Addresses as typed: plain on the selected bus, after the bus's name on the others."""
    for bus in workspace.buses.values():
        name = "" if bus.name == workspace.selected_bus else bus.name
        for drive in bus.drives.values():
            if not drive.address:
                yield f"{bus.name}:", f"{drive.label} {drive.product}".strip()
            else:
                yield join_target(name, drive.address), f"{drive.label} {drive.product}".strip()
        if "" not in bus.drives:
            yield join_target(name, "*"), f"every drive of {bus.name}"


def verbs(workspace: Workspace) -> Found:
    return ((verb.name, verb.lines[0]) for verb in VERBS.values() if verb.offered(workspace))


def offered(workspace: Workspace, listed: Listed, word: str) -> Found:
    """The values of an argument; `word`: what is typed of it."""
    drives = [pair for pair in targets(workspace) if not pair[0].endswith("*")]
    match listed:
        case Listed.DRIVE:
            yield from drives
        case Listed.AT_DRIVE:
            yield from ((f"@{name}", meaning) for name, meaning in drives)
        case Listed.BUS:
            yield from ((bus.name, ", ".join(bus.drives)) for bus in workspace.buses.values())
        case Listed.SIMULATED_DRIVE:
            cell = simulated_cell(workspace)
            for drive in cell.floor.drives if cell else ():
                name = drive.spec.name if drive.bus == workspace.selected_bus else f"{drive.bus}:{drive.spec.name}"
                yield name, drive.spec.personality
        case Listed.KEY:
            yield from ((key, "") for key in KEYS)
        case Listed.MACRO | Listed.PAGE:
            with contextlib.suppress(Diagnostic):
                names = workspace.macros.names() if listed is Listed.MACRO else workspace.macros.pages()
                yield from [(name, "macro" if listed is Listed.MACRO else "page of keys") for name in names]
        case Listed.PERSONALITY:
            yield from ((name, family) for family in PROGRAMS for name in simulated()[family].personalities)
        case Listed.URL:
            yield from ((name, connection.url) for name, connection in workspace.settings.connections.items())
            yield from ((form.prefix, form.meaning) for form in schemes().values())
            if word.startswith("sim:"):
                cells = (f"sim:{name}" for name, _ in _files(word[4:]))
                yield from ((name, "a cell") for name in cells if name.endswith((".toml", "/")))
            yield from _files(word)
        case Listed.WORD:
            yield from ((verb.name, verb.lines[0]) for verb in VERBS.values())
            language, product = spoken(workspace, DriveLine(""))
            yield from language.complete("", product)
        case Listed.FILE:
            yield from _files(word)


def _files(word: str) -> Found:
    folder, _, _ = word.rpartition("/")
    base = folder + "/" if "/" in word else ""
    try:
        with os.scandir(base or ".") as entries:
            entries_there = sorted((entry.name, entry.is_dir()) for entry in entries if not entry.name.startswith("."))
    except OSError:
        return []
    return [(f"{base}{name}/" if is_dir else f"{base}{name}", "") for name, is_dir in entries_there]
