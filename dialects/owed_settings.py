"""Settings that a certificate's question has changed: owed to the drive, and restored, also by the next session."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from multidrop.base.errors import NoAnswer, Refused
from multidrop.dialects.codec import Procedure
from multidrop.dialects.state import DriveState, Owed

Perform = Callable[[str], Procedure[tuple[str, ...]]]
"""Carries out a typed line."""


def owed(state: DriveState, lines: Sequence[str]) -> Owed:
    """What is owed to a drive while a question has changed its settings: these lines restore them."""
    return Owed(0, state.name, state.product, state.version, state.part, state.serial, "\n".join(lines))


def restored(state: DriveState, perform: Perform) -> Procedure[None]:
    """Restore the settings that a question has changed. A drive without a reply is owed them still.

    A refusal is noted: sending the line again would change nothing.
    """
    assert state.restore is not None
    for line in state.restore.lines.splitlines():
        try:
            yield from perform(line)
        except Refused as refusal:
            state.note(f"'{line}', the setting before a certificate's question, was refused: {refusal}")
    state.owes_nothing()


def repaired(state: DriveState, left: Iterable[Owed], perform: Perform) -> Procedure[None]:
    """Restore, in this very drive only, the settings that an interrupted certificate has left, and say so."""
    for mine in left:
        if mine.lines and mine.like(state) and mine.serial in ("", state.serial):
            state.owes(mine)
            settings = ", ".join(mine.lines.splitlines())
            try:
                yield from restored(state, perform)
            except NoAnswer as error:
                state.note(f"{settings}: not restored after an interrupted certificate: {error}")
            else:
                state.note(f"an interrupted certificate left other settings; restored: {settings}")
            return
