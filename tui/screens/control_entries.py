"""The entries of the page of controls: what each asks for, how it is read, and the lines that it would send."""

from __future__ import annotations

from dataclasses import dataclass

from multidrop.base.errors import Diagnostic
from multidrop.dialects.controls import BY, SET, SPEED, TARGET, TO, Control
from multidrop.dialects.units import Takes
from multidrop.shell.amounts import Amount, AmountReader
from multidrop.tui.readout import Readout
from multidrop.tui.widgets.lines import Row, Span, width_of


@dataclass(frozen=True)
class Entry:
    """A key that asks for an amount. `control`: the one that takes it; empty: it is the length of a step."""

    control: str
    what: str
    takes: Takes


ON_THE_FLY = "target"
"""The entry that `m` opens while the axis moves."""
ENTRIES = {
    "m": Entry(TO, "move to a position", Takes.PLACE),
    "b": Entry(BY, "move by a distance", Takes.DISTANCE),
    "p": Entry(SET, "the position here is", Takes.PLACE),
    "v": Entry(SPEED, "speed of the move, without sign", Takes.SPEED),
    ON_THE_FLY: Entry(TARGET, "new target of the move", Takes.PLACE),
    "l": Entry("", "length of a step", Takes.DISTANCE),
}


def filled(control: Control, axis: Readout, amount: Amount) -> tuple[str, ...]:
    """The lines of a move by a distance. Where they take a position, it is in the drive's own counts."""
    to = axis.last.position + amount.number if axis.last is not None else None
    return control.filled(by=amount.text, to="…" if to is None else to)


def moving_lines(entry: Entry, control: Control, axis: Readout, amount: Amount) -> tuple[str, ...]:
    """The lines that an entry sends."""
    if entry.control == BY:
        return filled(control, axis, amount)
    # A quantity is a place before the position is set, and another one after it.
    return control.filled(to=amount.number if entry.control == SET else amount.text)


def read(entry: Entry, text: str, reader: AmountReader) -> Amount:
    """Read what was typed. Raises Diagnostic."""
    amount = reader.read(text, entry.takes)
    if not entry.control and amount.number <= 0:
        raise Diagnostic(f"a step of {amount.typed} is no length", "", "type one above 0")
    return amount


def asked_rows(
    entry: Entry, text: str, reader: AmountReader, control: Control | None, axis: Readout, width: int
) -> list[Row]:
    """What is asked for, with what the entry would send, or why it would not; below each other where it is narrow."""
    label: list[Span] = [(f" {entry.what}: ", "strong"), (reader.asks(entry.takes), "dim")]
    if not text.strip():
        return [(*label, ("   Enter; Esc ↑↓ Tab leave", "dim"))]
    try:
        amount = read(entry, text, reader)
    except Diagnostic as problem:
        outcome: Span = (f"   {problem.message}", "motion")
    else:
        lines = moving_lines(entry, control, axis, amount) if control is not None else (f"a step of {amount.typed}",)
        other = reader.other(amount, entry.takes)
        outcome = (f"   → {', '.join(lines)}{f'  = {other}' if other else ''}", "strong")
    return [(*label, outcome)] if width_of([*label, outcome]) <= width else [tuple(label), (outcome,)]
