"""What features hear of the lines of a session, and what they keep with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from multidrop.base.foreign import callback
from multidrop.base.isolation import isolated
from multidrop.drives.bus import Bus

P = TypeVar("P")
OnBus = Callable[[Bus], None]


class Functions(list[OnBus]):
    """Functions in the order of their calls. What others wrote is guarded."""

    def append(self, function: OnBus) -> None:
        """Add a function at the end."""
        super().append(callback(function))


class SessionHooks:
    """The functions that are called with a line, each isolated from the others; and the objects that features keep."""

    def __init__(self) -> None:
        self.changed = Functions()
        """Called with each line that has changed, once that is published."""
        self.identified = Functions()
        """Called with each line whose drives were found."""
        self.forgotten = Functions()
        """Called with each line that is about to be closed."""
        self._parts: dict[type, object] = {}

    def tell(self, functions: Sequence[OnBus], bus: Bus) -> None:
        """Call functions with a line; a defect of one keeps nothing else from being done."""
        for function in functions:
            with isolated(f"a hook on {bus.name}"):
                try:
                    function(bus)
                except SystemExit as end:
                    raise RuntimeError("a hook ends the program") from end

    def keep(self, part: object) -> None:
        """Keep an object for as long as the session lives; `part` finds it by its class."""
        self._parts[type(part)] = part

    def part(self, kind: type[P]) -> P:
        """What a feature keeps. Raises LookupError where it keeps none."""
        part = self._parts[kind]
        assert isinstance(part, kind)
        return part
