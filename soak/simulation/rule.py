"""A rule of histories, its exceptions, and what the rules share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from soak.simulation.world import World


@dataclass(frozen=True)
class Grant:
    """An exception of a rule. `by`: a heading or a line in bold of docs/safety.md, or the number of a decision."""

    name: str
    by: str


class Granted(NamedTuple):
    """A breach that a grant excepts: it is counted, and breaks nothing."""

    grant: Grant
    text: str


Check = Callable[[World], Iterator[str | Granted]]


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
