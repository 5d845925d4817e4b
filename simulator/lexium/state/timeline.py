"""The virtual time of one simulated drive, and the notification that its next event may have changed."""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter

Event = tuple[float, Callable[[float], None]]
"""When something happens, s, and what carries it out then."""


when = itemgetter(0)
"""The key that finds the first of several events."""


def nothing(t: float) -> None:
    """An event of which the next look at the inputs and the rotor makes what there is to make."""


class Timeline:
    """`now`, in seconds, which never goes back. `outdated`: the next event must be worked out again."""

    __slots__ = ("now", "outdated")

    def __init__(self) -> None:
        self.now = 0.0
        self.outdated = True

    def replan(self) -> None:
        """Request that the next event be worked out again: something on which it depends has changed."""
        self.outdated = True
