"""What a script or a macro asks of drives: the values of an expression, at the place that is selected for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic, DriveError
from multidrop.base.text import counted
from multidrop.drives.drive import Check, Drive
from multidrop.shell.line_syntax import join_target, pinned, split_target
from multidrop.shell.origin import Origin
from multidrop.shell.scripts.expression import (
    Binary,
    Comparison,
    Constant,
    DriveQuestion,
    Expression,
    Measured,
    Name,
    Unary,
    Value,
    unknowns,
    value_of,
)
from multidrop.shell.session import Session
from multidrop.shell.workspace import Workspace

if TYPE_CHECKING:
    from multidrop.shell.units import ComparedQuantity


class MacroSelection:
    """The selection of one macro, which no other selection changes."""

    def __init__(self, workspace: Workspace, origin: Origin, caller: MacroSelection | None = None) -> None:
        """Take the selection of the macro that calls this one, else the present one. `origin`: that of its lines."""
        self._workspace, self._origin = workspace, origin
        self._at: tuple[str, str] = workspace.place if caller is None else caller._at

    def pinned(self, line: str) -> str:
        """The line, with an address where another drive is selected now."""
        if self._workspace.place == self._at:
            return line
        words = line.split()
        if words[:1] == ["/use"] and len(words) == 2 and self._is_address(words[1]):
            return f"/use {join_target(self._at[0], words[1])}"
        return pinned(line, *self._at)

    def _is_address(self, word: str) -> bool:
        """True if a word is the address of a drive on the macro's bus, and neither a bus nor a role."""
        return ":" not in word and self._origin.bus_of_role(word) not in self._workspace.buses

    def target(self, target: str) -> str:
        """The target of a question, with what the macro's selection adds."""
        bus, address = split_target(target)
        if bus or self._workspace.place == self._at:
            return target
        return join_target(self._at[0], address or self._at[1])

    def passed(self, line: str) -> None:
        """Take the selection over after a `/use` of the macro."""
        if line.split()[:1] == ["/use"]:
            self._at = self._workspace.place


Checks = dict[DriveQuestion, "ComparedQuantity"]
"""The questions with whose values quantities are compared."""


async def converted(
    session: Session, origin: Origin, tree: Expression, place: MacroSelection | None = None
) -> tuple[Expression, Checks]:
    """The expression with numbers of the drive in place of quantities. Raises Diagnostic."""
    if isinstance(tree, Unary):
        operand, checks = await converted(session, origin, tree.operand, place)
        return replace(tree, operand=operand), checks
    if isinstance(tree, Binary):
        left, checks = await converted(session, origin, tree.left, place)
        right, more = await converted(session, origin, tree.right, place)
        return replace(tree, left=left, right=right), checks | more
    if not isinstance(tree, Comparison):
        return tree, {}
    word = next((side for side in (tree.left, tree.right) if isinstance(side, DriveQuestion)), None)
    tree_now, checks = tree, Checks()
    for part in ("left", "right", "within"):
        value = getattr(tree, part)
        if isinstance(value, Measured) and word is not None:
            drive = drive_of(session, origin, word, place)
            question, within = _question(session, drive, word), part == "within"
            checks[word] = compared = await session.units.condition(drive, question, value.text, within)
            tree_now = replace(tree_now, **{part: Constant(compared.number)})  # type: ignore[arg-type]
    return tree_now, checks


async def known(
    session: Session,
    origin: Origin,
    tree: Expression,
    values: Mapping[str, str],
    place: MacroSelection | None,
    checks: Checks,
) -> dict[Name | DriveQuestion, Value]:
    """Find the value of each name and word of an expression; each word is read once.

    Raises Diagnostic for a word that is not a question, DriveError where a drive refuses or prints no single value.
    """
    answers: dict[Name | DriveQuestion, Value] = {}
    for unknown in unknowns(tree):
        if unknown not in answers:
            if isinstance(unknown, Name):
                answers[unknown] = value_of(values[unknown.name])
            else:
                answers[unknown] = await ask(
                    session, origin, unknown, place, checks[unknown].check if unknown in checks else None
                )
    return answers


def drive_of(workspace: Workspace, origin: Origin, word: DriveQuestion, place: MacroSelection | None = None) -> Drive:
    """Find the drive that a word asks. Raises Diagnostic or NoAnswer."""
    bus, address = origin.target(place.target(word.target) if place is not None else word.target)
    return workspace.drive(bus, address or None)


async def ask(
    session: Session,
    origin: Origin,
    word: DriveQuestion,
    place: MacroSelection | None = None,
    check: Check | None = None,
) -> Value:
    """Read the value of a word. Raises Diagnostic, DriveError or TransportLost."""
    drive = drive_of(session, origin, word, place)
    line = _question(session, drive, word)
    await session.path.guard(drive, line, origin.by)
    printed = await drive.send(line, check)
    if len(printed) != 1:
        raise DriveError(
            f"{session.display_name(drive)}: {line} printed {counted(len(printed), 'line')}; a value is one"
        )
    return value_of(printed[0])


def _question(workspace: Workspace, drive: Drive, word: DriveQuestion) -> str:
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
