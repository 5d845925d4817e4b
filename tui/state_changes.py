"""Changes of a drive between two readings, in words: a limit, an error, the end of a program, silence.

Only readings that are made anyway are compared, and the first one is the start. A line says what was read and no more:
the cause is for a person to find.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.events import Conditioned, Sample, Silent
from multidrop.tui.readout import Readout
from multidrop.tui.text import digits

LIMITS = {"lim+": "limit+", "lim-": "limit-"}
"""Lamps whose lighting is reported, by function."""
ALARMS = ("fault", "failed", "locked", "error", "overflow", "stall")
"""Words in a drive's own values that are reported when they appear."""


class Happening(NamedTuple):
    """One line; `warning` where it needs a person, and the line that shows more of it."""

    text: str
    warning: bool = False
    help: str = ""


SILENT = Happening("does not reply to polls", warning=True)
BACK = Happening("replies again")


def changes_of(known: Readout, event: Sample | Silent | Conditioned) -> Iterator[Happening]:
    """Compare an event of a drive with what was read before it."""
    if isinstance(event, Silent):
        if known.silent_since is None:
            yield SILENT
    elif isinstance(event, Sample):
        if known.silent_since is not None:
            yield BACK
        axis = next((each for each in known.axes if each.axis == event.axis), None)
        if axis is not None and axis.last is not None and axis.trouble != event.trouble:
            text = event.trouble or f"no more: {axis.trouble}"
            yield Happening(_named(text, event.axis), warning=bool(event.trouble))
    else:
        for each, after in zip(known.axes, event.conditions, strict=False):
            yield from _conditioned(each, after, known.failed_at)


def _conditioned(known: Readout, after: Conditions, failed_at: float) -> Iterator[Happening]:
    """The changes between two readings of an axis, most urgent first: limits, error, alarms, program, current."""
    before, last = known.conditions, known.last
    if before is None:
        return
    lit = {(lamp.name, lamp.function) for lamp in before.lamps if lamp.on}
    for lamp in after.lamps:
        if lamp.on and lamp.function in LIMITS and not lamp.output and (lamp.name, lamp.function) not in lit:
            place = "" if last is None else f" at {digits(last.position)}"
            stands = "; it stands" if last is not None and last.velocity == 0 else ""
            yield Happening(_named(f"{LIMITS[lamp.function]} reached{place}{stands}", after.axis), warning=True)
    told = failed_at >= known.conditioned_at or (after.error_text and after.error_text == known.trouble)
    if after.error and not before.error and not told:
        if after.error == UNREAD:
            yield Happening(_named("an error is set", after.axis), True, after.error_text)
        else:
            yield Happening(_named(f"error {after.error}: {after.error_text}", after.axis), True)
    values = dict(before.more)
    for name, value in after.more:
        if value != values.get(name, "") and any(word in value for word in ALARMS):
            yield Happening(_named(f"{name}: {value}", after.axis), warning=True)
    if before.program and not after.program:
        which = "" if before.program == "running" else f" {before.program}"
        yield Happening(_named(f"the program{which} has ended", after.axis))
    if after.program and not before.program:
        text = "a program runs" if after.program == "running" else f"program {after.program}"
        yield Happening(_named(text, after.axis))
    if after.no_current and not before.no_current:
        yield Happening(_named(f"no current in the motor ({after.no_current}): nothing holds the load", after.axis))
    if before.no_current and not after.no_current:
        yield Happening(_named("current in the motor again", after.axis))
    if before.error and not after.error:
        yield Happening(_named("the error is cleared", after.axis))


def _named(text: str, axis: str) -> str:
    return f"{axis}: {text}" if axis else text
