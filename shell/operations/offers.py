"""The values of a usage's placeholders: open buses and drives, files, words of the drives' languages."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic
from multidrop.dialects.families import DEFAULT, FAMILIES
from multidrop.macros import KEYS
from multidrop.shell.connect.url_forms import URL_FORMS
from multidrop.shell.lines import DriveLine, join_target
from multidrop.shell.operations.table import VERBS
from multidrop.simulator.families import PROGRAMS, TABLE

if TYPE_CHECKING:
    from multidrop.dialects.family import Language
    from multidrop.drives.drive import Drive
    from multidrop.shell.workspace import Workspace

Found = Iterable[tuple[str, str]]
"""Texts, each with its meaning."""


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
    return ((verb.name, verb.lines[0]) for verb in VERBS.values() if verb.fits is None or verb.fits(workspace))


def _drives(workspace: Workspace, word: str) -> Found:
    return (pair for pair in targets(workspace) if not pair[0].endswith("*"))


def _at(workspace: Workspace, word: str) -> Found:
    return ((f"@{name}", meaning) for name, meaning in _drives(workspace, word))


def _buses(workspace: Workspace, word: str) -> Found:
    return ((bus.name, ", ".join(bus.drives)) for bus in workspace.buses.values())


def _either(workspace: Workspace, word: str) -> Found:
    yield from _drives(workspace, word)
    yield from _buses(workspace, word)


def _macros(workspace: Workspace, word: str) -> Found:
    try:
        return [(name, "macro") for name in workspace.macros.names()]
    except Diagnostic:
        return []


def _words(workspace: Workspace, word: str) -> Found:
    yield from ((verb.name, verb.lines[0]) for verb in VERBS.values())
    language, product = spoken(workspace, DriveLine(""))
    yield from language.complete("", product)


def _keys(workspace: Workspace, word: str) -> Found:
    return ((key, "") for key in KEYS)


def _pages(workspace: Workspace, word: str) -> Found:
    try:
        return [(page, "page of keys") for page in workspace.macros.pages()]
    except Diagnostic:
        return []


def _files(workspace: Workspace, word: str) -> Found:
    folder, _, _ = word.rpartition("/")
    base = folder + "/" if "/" in word else ""
    try:
        with os.scandir(base or ".") as entries:
            found = sorted((entry.name, entry.is_dir()) for entry in entries if not entry.name.startswith("."))
    except OSError:
        return []
    return [(f"{base}{name}/" if is_dir else f"{base}{name}", "") for name, is_dir in found]


def _urls(workspace: Workspace, word: str) -> Found:
    yield from ((name, each.url) for name, each in workspace.settings.connections.items())
    yield from ((form.prefix, form.meaning) for form in URL_FORMS.values())
    yield from _files(workspace, word)


def _personalities(workspace: Workspace, word: str) -> Found:
    for family in PROGRAMS:
        yield from ((name, family) for name in TABLE[family].personalities)


def _simulated(workspace: Workspace, word: str) -> Found:
    for each in workspace.cell.floor.drives if workspace.cell else ():
        place = each.spec.name if each.bus == workspace.selected_bus else f"{each.bus}:{each.spec.name}"
        yield place, each.spec.personality


PLACEHOLDERS: Mapping[str, Callable[[Workspace, str], Found]] = {
    "ADDR": _drives,
    "@ADDR": _at,
    "BUS": _buses,
    "BUS[:ADDR]": _either,
    "DRIVE": _simulated,
    "F2..F12": _keys,
    "FILE": _files,
    "FILE.rrd": _files,
    "MACRO": _macros,
    "PAGE": _pages,
    "PERSONALITY": _personalities,
    "URL": _urls,
    "WORD": _words,
}
"""By the word of a usage; only a person knows the value of any other placeholder."""
