"""Kinds of endpoints that features add to the cell file's `serve`. Imports nothing that takes time."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import AsyncExitStack
from typing import Any, NamedTuple

from multidrop.base import registry
from multidrop.base.feature import Kinds
from multidrop.simulator.cell.spec import Endpoint

Floor = Any
"""`simulator.serving.running.RunningFloor`, which has an event loop; this module has none. A function names it."""


class EndpointKind(NamedTuple):
    """A way in to a bus from outside, as `usbip://127.0.0.1:3240` in `serve`."""

    scheme: str
    """What stands before `://HOST:PORT`."""
    open: Callable[[Floor, str, Endpoint, AsyncExitStack], Awaitable[list[str]]]
    """Open an endpoint of a bus, which the stack closes; return what clients open. Raises OSError."""
    families: tuple[str, ...] = ()
    """The families of the drives that have it; empty: all."""
    lack: str = ""
    """What is said of a drive of another family: `has no USB`."""
    remark: Callable[[str], str] | None = None
    """What is told to a person of an open endpoint."""

    def passes(self) -> Mapping[str, Kinds]:
        """What its callers expect to be raised, besides what a person reads; see `base.foreign`."""
        return {"open": (OSError,)}

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return (f"serve {self.scheme}:",)


def kinds() -> Iterator[EndpointKind]:
    """All kinds that features add."""
    return registry.added(EndpointKind)


def kind_of(scheme: str) -> EndpointKind | None:
    """Find the kind of a scheme; None: no feature adds it. Raises Diagnostic where its feature is not there."""
    return next((kind for kind in registry.answering(EndpointKind, f"{scheme}:") if kind.scheme == scheme), None)
