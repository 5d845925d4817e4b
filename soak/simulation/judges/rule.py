"""A rule of histories, its exceptions, and what rules read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from soak.simulation.records.climate import Climate
from soak.simulation.records.history import History
from soak.simulation.records.places import Place


class Datagrams(Protocol):
    """What the network did to datagrams: see `system.network.Network`."""

    doubled: list[tuple[str, bytes]]
    astray: list[tuple[float, str]]
    overtaken: list[tuple[float, float, str]]


class Lived(Protocol):
    """What a rule reads of a life: its history, its machine, and what was done to both. A `World` is one."""

    history: History
    climate: Climate
    places: list[Place]
    cut: dict[tuple[str, str], list[float]]

    @property
    def network(self) -> Datagrams:
        """The network of the life."""

    def place(self, line: str) -> Place:
        """A line of the machine."""


@dataclass(frozen=True)
class Grant:
    """An exception of a rule. `by`: a heading or a line in bold of docs/safety.md, or the number of a decision."""

    name: str
    by: str


class Granted(NamedTuple):
    """A breach that a grant excepts: it is counted, and breaks nothing."""

    grant: Grant
    text: str


Check = Callable[[Lived], Iterator[str | Granted]]


@dataclass(frozen=True)
class Rule:
    """A rule. `promise`: the heading of docs/safety.md, or the number of the decision, that promises it.

    `check` yields the breaches, in words; an excepted one has one of the rule's grants.
    """

    name: str
    sentence: str
    promise: str
    check: Check
    grants: tuple[Grant, ...] = ()
