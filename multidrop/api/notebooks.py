"""What a notebook shows of the objects of the API below a cell: pictures, which a feature makes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from multidrop.base import registry
from multidrop.base.errors import Diagnostic

Telemetry = Any
"""`api.blocking.Telemetry`, which knows this module."""


class Live(Protocol):
    """A picture that is kept up to date below a cell, until `close`, the end of the session, or an hour."""

    def close(self) -> None:
        """End it; the last picture stays. May be called again."""


class Pictures(NamedTuple):
    """The pictures of objects."""

    html: Mapping[str, Callable[[Any], str]]
    """The HTML of an object, by its kind: `Session` (an AsyncSession), `Drive` (its facts), `Run`, `Samples`."""
    live: Callable[[Telemetry], Live]
    """Begin a picture of what is read. Raises Diagnostic outside a notebook."""

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return ("the live picture", *(f"the picture of {kind}" for kind in self.html))


def picture(kind: str, found: object) -> str | None:
    """The HTML of an object; None where no feature draws it, or it cannot: the notebook shows its text then."""
    import logging

    for pictures in registry.added(Pictures):
        if kind in pictures.html:
            try:
                return pictures.html[kind](found)
            except Diagnostic as failure:
                logging.getLogger("multidrop").warning("%s", failure)
                return None
    return None


def live(readings: Telemetry) -> Live:
    """Begin a picture of what is read. Raises Diagnostic outside a notebook."""
    return registry.needed(Pictures, "Session.live").live(readings)
