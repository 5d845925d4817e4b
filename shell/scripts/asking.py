"""The values of an expression's words: each drive is asked once, now, with a line that only reads."""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.dialects import Diagnostic, DriveError
from multidrop.drives.drive import Drive
from multidrop.shell.events import By
from multidrop.shell.lines import split_target
from multidrop.shell.roles import Commands
from multidrop.shell.scripts.expression import Expression, Name, Word, unknowns
from multidrop.shell.scripts.place import Place
from multidrop.shell.scripts.values import Value, value_of
from multidrop.shell.workspace import Workspace


async def known(
    workspace: Workspace,
    commands: Commands,
    tree: Expression,
    values: Mapping[str, str],
    by: By,
    place: Place | None = None,
) -> dict[Name | Word, Value]:
    """Find the value of each name and word of an expression; each word is read once.

    Raises Diagnostic for a word that is not a question, DriveError where a drive refuses or prints no single value.
    """
    found: dict[Name | Word, Value] = {}
    for each in unknowns(tree):
        if each not in found:
            found[each] = (
                value_of(values[each.name])
                if isinstance(each, Name)
                else await ask(workspace, commands, each, by, place)
            )
    return found


def drive_of(workspace: Workspace, word: Word, place: Place | None = None) -> Drive:
    """Find the drive that a word asks. Raises Diagnostic or NoAnswer."""
    bus, address = split_target(place.target(word.target) if place is not None else word.target)
    return workspace.drive(bus, address or None)


async def ask(workspace: Workspace, commands: Commands, word: Word, by: By, place: Place | None = None) -> Value:
    """Read the value of a word. Raises Diagnostic, DriveError or TransportLost."""
    drive = drive_of(workspace, word, place)
    line = _question(workspace, drive, word)
    await commands.guard(drive, line, by)
    printed = await drive.send(line)
    if len(printed) != 1:
        raise DriveError(f"{workspace.display_name(drive)}: {line} printed {len(printed)} lines; a value is one")
    return value_of(printed[0])


def _question(workspace: Workspace, drive: Drive, word: Word) -> str:
    name = workspace.display_name(drive)
    if drive.link.name in workspace.raw:
        raise Diagnostic("is in raw mode, where no drive is asked", drive.link.name, "/raw off ends it")
    if drive.programming:
        raise DriveError(f"{name} is in program mode and would store the question; PG ends it")
    line = word.text if word.line else drive.family.question(word.text)
    if line is None:
        raise Diagnostic(f"{word.text} has no value to read", name, "[LINE] asks with a line that prints one value")
    if drive.starts(line):
        raise Diagnostic(f"{word.shown} can start motion, and a question only reads; nothing was sent", name)
    return line
