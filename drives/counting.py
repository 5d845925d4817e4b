"""Whether what the counts of a drive's axes rest on is still what was accepted for their scales.

A scale is accepted together with the settings that give one count its length. Whatever may have changed one of them is
counted in the drive's state (`recounts`): a line, a restart, a reply after silence. From then on the scale does not
hold, until a reading shows the settings that were accepted.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from multidrop.dialects.codec import Kind, Priority, Procedure, Request, at_priority
from multidrop.dialects.state import DriveState
from multidrop.dialects.values import Value, number

if TYPE_CHECKING:
    from multidrop.dialects.units import Settings, Units


class Counting:
    """The accepted settings of the axes that have a scale, and those last read."""

    def __init__(self) -> None:
        self._accepted: dict[str, Settings] = {}
        self._read: dict[str, tuple[int, Settings]] = {}
        """By axis: `recounts` before the reading, and what was read."""

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes with a scale that was accepted."""
        return tuple(self._accepted)

    @property
    def names(self) -> set[str]:
        """The settings that the scales rest on."""
        return {name for settings in self._accepted.values() for name, _ in settings}

    def accept(self, axis: str, settings: Settings, recounts: int) -> None:
        """Take these settings, just read, as those that the scale of an axis rests on."""
        self._accepted[axis] = settings
        self._read[axis] = recounts, settings

    def forget(self, axis: str) -> None:
        """Record that an axis has no scale any more."""
        self._accepted.pop(axis, None)
        self._read.pop(axis, None)

    def saw(self, axis: str, settings: Settings, recounts: int) -> None:
        """Record the settings that a reading has shown, which began when `recounts` had this value."""
        self._read[axis] = recounts, settings

    def holds(self, axis: str, recounts: int) -> bool:
        """Whether the settings of an axis are those that were accepted, as far as is known; True without a scale."""
        accepted = self._accepted.get(axis)
        return accepted is None or self._read[axis] == (recounts, accepted)

    def read_since(self, recounts: int) -> bool:
        """Whether the settings of every axis were read since the last thing that may have changed one."""
        return all(self._read[axis][0] == recounts for axis in self._accepted)

    def sent(self, request: Request, units: Units, state: DriveState) -> None:
        """Note a request that may be executed, if it may change what the axes with a scale count."""
        stored = request.kind is Kind.PROGRAM or state.programming
        if self._accepted and not stored and units.recounts(request):
            state.counts_may_have_changed()

    def contradicted(self, values: Mapping[str, Value], units: Units) -> bool:
        """Whether settings of a drive, by name, are other ones than were accepted for one of its axes."""
        return any(
            number(values[name]) != float(accepted)
            for axis, settings in self._accepted.items()
            for setting, accepted in settings
            if (name := units.setting_name(axis, setting)) in values
        )

    def changes(self, axis: str) -> list[str]:
        """The settings that were last read with another value: `MS was 256 and is 128 now`."""
        if axis not in self._accepted:
            return []
        accepted, (_, read) = dict(self._accepted[axis]), self._read[axis]
        return [f"{key} was {accepted.get(key)} and is {now} now" for key, now in read if accepted.get(key) != now]

    def reading(self, units: Units, state: DriveState, priority: Priority) -> Procedure[dict[str, list[str]]]:
        """Read what the scales rest on; return what differs, by axis, where that was not known before."""
        news = {}
        for axis in self.axes:
            before, recounts = self.changes(axis), state.recounts
            basis = yield from at_priority(units.basis(axis, None), priority)
            self.saw(axis, basis.settings, recounts)
            if (changes := self.changes(axis)) and changes != before:
                news[axis] = changes
        return news
