"""The states that a plot shows beside its curves: the program that runs, the error, inputs and outputs."""

from __future__ import annotations

from collections.abc import Iterator

from multidrop.dialects.values import UNREAD, Conditions

ON = {True: "on", False: "off", None: ""}


def states_of(conditions: Conditions) -> Iterator[tuple[str, str]]:
    """The name of each lane and its state; an empty state is not known."""
    yield "program", conditions.program or "none"
    yield "error", _error(conditions)
    for lamp in conditions.lamps:
        if lamp.function.isdecimal():
            continue  # an analogue input, whose value can be plotted
        kind = "output" if lamp.output else "input"
        function = lamp.function.replace("+", " plus").replace("-", " minus").split()
        yield "-".join((kind, lamp.name, *function)), ON[lamp.on]


def _error(conditions: Conditions) -> str:
    if not conditions.error:
        return "none"
    number = "set" if conditions.error == UNREAD else str(conditions.error)
    return f"{number} {conditions.error_text}".strip()
