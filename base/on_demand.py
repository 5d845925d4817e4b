"""Records by name, each imported at its first use, so that a command pays only for what it works on."""

from __future__ import annotations

import contextlib
import gc
import importlib
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

T = TypeVar("T")


@contextlib.contextmanager
def importing() -> Iterator[None]:
    """Pause the collector of garbage: what an import makes stays, so it would look in vain.

    Afterwards all objects count as old, so the next collection visits none of them; frozen ones stay frozen.
    """
    collects, frozen = gc.isenabled(), gc.get_freeze_count()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.freeze()
            if not frozen:
                gc.unfreeze()
            gc.enable()


def imported(place: str) -> Any:
    """Import what a `MODULE:ATTRIBUTE` names."""
    module, _, attribute = place.partition(":")
    if module not in sys.modules:  # else `importing`, which counts all frozen objects, would take longer than the rest
        with importing():
            importlib.import_module(module)
    return getattr(importlib.import_module(module), attribute)


def imported_if(place: str) -> Any:
    """Import what a `MODULE:ATTRIBUTE` names; None for an empty place."""
    return imported(place) if place else None


class OnDemand(Mapping[str, T]):
    """A mapping of names to what is at a `MODULE:ATTRIBUTE`. Names and membership import none of that."""

    def __init__(self, places: Callable[[], Mapping[str, str]]) -> None:
        """`places`: gives the places by name, as they are declared now."""
        self._places = places
        self._found: dict[str, T] = {}

    def __getitem__(self, name: str) -> T:
        if name not in self._found:
            self._found[name] = imported(self._places()[name])
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._places())

    def __len__(self) -> int:
        return len(self._places())

    def __contains__(self, name: object) -> bool:
        return name in self._places()
