"""Records by name, each imported at its first use, so that a command pays only for what it works on."""

from __future__ import annotations

import gc
import importlib
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

T = TypeVar("T")


def imported(place: str) -> Any:
    """Import what a `MODULE:ATTRIBUTE` names. What an import makes stays, so the collector would look in vain."""
    module, _, attribute = place.partition(":")
    collects = gc.isenabled()
    gc.disable()
    try:
        return getattr(importlib.import_module(module), attribute)
    finally:
        if collects:
            gc.enable()


class OnDemand(Mapping[str, T]):
    """A mapping of names to records at a `MODULE:ATTRIBUTE`. Names and membership import nothing."""

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = dict(places)
        self._found: dict[str, T] = {}

    def __getitem__(self, name: str) -> T:
        if name not in self._found:
            self._found[name] = imported(self._places[name])
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, name: object) -> bool:
        return name in self._places
