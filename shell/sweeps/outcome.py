"""The result of one run of a program, in the terms of conditions, whatever the family of the drive is."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from multidrop.simulator.program_run import Event

BY_ITSELF = ("E", "END")
"""The ends of a program that has ended by itself."""
ENDS = (*BY_ITSELF, "error", "until")
Position = int | tuple[int, ...]


class Outcome(NamedTuple):
    """`position` has a number for each axis, `errors` those that the program did not handle, in their order."""

    position: Position = 0
    errors: tuple[int | str, ...] = ()
    prints: tuple[str, ...] = ()
    virtual_s: float = 0.0
    ended: str = "E"


def outcome_of(events: Iterable[Event]) -> Outcome:
    """Run to the end, and take the result from the events."""
    prints: list[str] = []
    fact = {}
    for event in events:
        fact = event.fact(0.0)
        if "print" in fact:
            prints.append(fact["print"])
    summary = fact["summary"]
    place = summary["position"]
    return Outcome(
        position=tuple(place.values()) if isinstance(place, dict) else place,
        errors=tuple(summary["errors"]),
        prints=tuple(prints),
        virtual_s=summary["virtual_s"],
        ended=summary["ended"],
    )
