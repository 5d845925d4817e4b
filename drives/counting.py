"""Whether what the counts of a drive's axes rest on is still what was accepted for their scales.

A scale is accepted together with the settings that give one count its length. Whatever may have changed one of them is
counted in the drive's state (`recounts`): a line, a restart, a reply after silence. From then on the scale does not
hold, until a reading shows the settings that were accepted.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Protocol

from multidrop.dialects.codec import Kind, Priority, Procedure, Request, at_priority
from multidrop.dialects.family import Family
from multidrop.dialects.state import DriveState
from multidrop.dialects.values import Value, number

if TYPE_CHECKING:
    from multidrop.dialects.units import Settings, Units


class Counted(Protocol):
    """A drive, as far as its counts need it."""

    @property
    def counting(self) -> Counting: ...
    @property
    def state(self) -> DriveState: ...
    @property
    def family(self) -> Family[Any]: ...


def note(drives: Iterable[Counted], request: Request) -> None:
    """Note a request for these drives, which may be executed, that may change what their axes count."""
    if request.kind is Kind.PROGRAM:
        return
    for each in drives:
        if each.counting.axes and not each.state.programming and each.family.units.recounts(request):
            each.state.counts_may_have_changed()


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

    def saw(self, axis: str, settings: Settings, recounts: int) -> None:
        """Record the settings that a reading has shown, which began when `recounts` had this value."""
        self._read[axis] = recounts, settings

    def holds(self, axis: str, recounts: int) -> bool:
        """Whether the settings of an axis are those that were accepted, as far as is known; True without a scale."""
        accepted = self._accepted.get(axis)
        return accepted is None or self._read[axis] == (recounts, accepted)

    def contradicted(self, values: Mapping[str, Value]) -> bool:
        """Whether settings of a drive, by name, are other ones than were accepted for one of its axes."""
        return any(
            number(values[key]) != float(accepted)
            for axis, settings in self._accepted.items()
            for name, accepted in settings
            if (key := f"{name}_{axis}" if axis not in ("", "0") and axis.isdigit() else name) in values
        )

    def changes(self, axis: str) -> list[str]:
        """The settings that were last read with another value: `MS was 256 and is 128 now`."""
        if axis not in self._accepted:
            return []
        accepted, (_, read) = dict(self._accepted[axis]), self._read[axis]
        return [f"{key} was {accepted.get(key)} and is {now} now" for key, now in read if accepted.get(key) != now]

    def reading(self, units: Units[Any], state: DriveState, priority: Priority) -> Procedure[dict[str, list[str]]]:
        """Read what the scales rest on; return what differs, by axis, where that was not known before."""
        news = {}
        for axis in self.axes:
            before, recounts = self.changes(axis), state.recounts
            found = yield from at_priority(units.basis(state, axis, None), priority)
            self.saw(axis, found.settings, recounts)
            if (changes := self.changes(axis)) and changes != before:
                news[axis] = changes
        return news
