"""What a notebook shows of the objects of the API below a cell: pictures, which a feature makes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from multidrop.base import registry

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


def picture(kind: str, found: object) -> str | None:
    """The HTML of an object; None where no feature draws it: the notebook shows its text then."""
    drawing = (each.html[kind] for each in registry.added(Pictures) if kind in each.html)
    return next((draw(found) for draw in drawing), None)


def live(readings: Telemetry) -> Live:
    """Begin a picture of what is read. Raises Diagnostic outside a notebook."""
    return registry.needed(Pictures, "Session.live").live(readings)
