"""Settings that are read and written one by one, each by its name; a plan writes them in the order of the names."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from multidrop.dialects.codec import Procedure
from multidrop.dialects.values import (
    Change,
    Pairs,
    Parameters,
    Progress,
    Reading,
    Readings,
    Value,
    read_each,
    same,
)


class ListedParameters(Parameters, ABC):
    """The settings of a drive that has a list of them."""

    unread: Pairs = ()
    """What can never be read, with reasons."""

    @abstractmethod
    def names(self) -> Sequence[str]:
        """The settings, in the order in which they are written."""

    @abstractmethod
    def read_one(self, name: str) -> Procedure[Reading]:
        """Read a setting. Raises Refused or NoAnswer."""

    @abstractmethod
    def checked(self, name: str, value: Value) -> Value:
        """Return a value as it is written. Raises Diagnostic for an unknown setting, or a value out of range."""

    @abstractmethod
    def line(self, name: str, value: Value) -> str:
        """The line that gives a setting a value."""

    def ordered(self, names: list[str], now: Mapping[str, Value], goal: Mapping[str, Value]) -> list[str]:
        """The order in which the drive refuses none of the values."""
        return names

    def read(self, progress: Progress) -> Procedure[Readings]:
        """Read every setting; a refused one is listed. Raises NoAnswer. Nothing is changed."""
        return (yield from read_each(self.names(), self.read_one, progress, self.unread))

    def steps(
        self, present: Readings, wanted: Mapping[str, Value], withheld: Mapping[str, str], cannot: dict[str, str]
    ) -> Sequence[Change]:
        now = present.values
        goal = {
            name: self.checked(name, value)
            for name, value in wanted.items()
            if name not in withheld and name not in cannot and not same(value, now.get(name))
        }
        order = self.ordered([name for name in self.names() if name in goal], now, goal)
        return [Change(name, now.get(name), goal[name], self.line(name, goal[name])) for name in order]
