"""Requests of several front ends for the same readings: each thing is read as often as the most eager one asks."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Generic, TypeVar

Thing = TypeVar("Thing", bound=Hashable)


class Subscription(Generic[Thing]):
    """A request for readings of some things, each every `period` s, until it is closed."""

    def __init__(self, things: Sequence[Thing], period: float, ended: Callable[[Subscription[Thing]], None]) -> None:
        self.things, self.period = tuple(things), period
        self._ended = ended

    def close(self) -> None:
        """End it; a second call has no effect."""
        self._ended(self)


class Subscriptions(Generic[Thing]):
    """The open subscriptions of one reader. `shortest`: the least period, s; `changed` is called after each change."""

    def __init__(self, shortest: float, changed: Callable[[], None]) -> None:
        self.periods: dict[Thing, float] = {}
        """The shortest period requested for each thing, s."""
        self._open: list[Subscription[Thing]] = []
        self._shortest, self._changed = shortest, changed

    def add(self, things: Sequence[Thing], period: float) -> Subscription[Thing]:
        """Begin a subscription."""
        subscription = Subscription(things, max(period, self._shortest), self._end)
        self._open.append(subscription)
        self._count()
        return subscription

    def clear(self) -> None:
        """End all subscriptions."""
        self._open.clear()
        self._count()

    def _end(self, subscription: Subscription[Thing]) -> None:
        if subscription in self._open:
            self._open.remove(subscription)
            self._count()

    def _count(self) -> None:
        self.periods = {}
        for each in self._open:
            for thing in each.things:
                self.periods[thing] = min(each.period, self.periods.get(thing, each.period))
        self._changed()
