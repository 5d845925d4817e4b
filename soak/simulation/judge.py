"""The judge: rules that hold in every history, each with a name, a sentence, and the place that promises it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from soak.simulation.history import Command, Outcome
from soak.simulation.world import World

SOON = 0.05
"""The time, s, in which the kernel takes a stop: a line that takes nothing meanwhile is lost, or flooded."""
Check = Callable[[World], Iterator[str]]


@dataclass(frozen=True)
class Rule:
    """A rule. `promise`: the heading of docs/safety.md that promises it. `check` yields the breaches, in words."""

    name: str
    sentence: str
    promise: str
    check: Check


def _times(world: World) -> Counter[tuple[str, str, str]]:
    return Counter((each.line, each.drive, each.text) for each in world.history.executed)


def _said(command: Command, times: int) -> str:
    where = f"{command.line}:{command.drive} {command.text!r}"
    return f"{where}: {command.outcome.value} ({command.said}), executed {times} times"


def _once(world: World) -> Iterator[str]:
    times = _times(world)
    for each in world.history.commands.values():
        count = times[each.line, each.drive, each.text]
        if count > 1:
            yield _said(each, count)


def _unsent(world: World) -> Iterator[str]:
    times = _times(world)
    for each in world.history.commands.values():
        count = times[each.line, each.drive, each.text]
        if not count or each.outcome not in (Outcome.NOT_SENT, Outcome.REFUSED):
            continue
        if each.outcome is Outcome.REFUSED and world.climate.wire.harmful and not world.place(each.line).checked:
            world.history.count("excepted: an error of noise on a line without a checksum")
            continue
        yield _said(each, count)


def _done(world: World) -> Iterator[str]:
    if world.climate.wire.harmful:
        return  # a checksum of seven bits, or none, lets some damage pass
    times = _times(world)
    for each in world.history.commands.values():
        count = times[each.line, each.drive, each.text]
        if not count and each.outcome is Outcome.OK:
            yield _said(each, count)


def _nothing_before(world: World) -> Iterator[str]:
    """Bytes of a command that was typed before a stop leave after it."""
    for each in world.history.commands.values():
        stops = [stop.at for stop in world.history.stops if stop.who == each.who]
        if each.stops >= len(stops):
            continue
        stop = stops[each.stops]
        text = re.compile(rb"(?<![0-9A-Za-z])" + re.escape(each.text.encode()) + rb"(?![0-9])")
        for at, line, data in world.history.written:
            if at > stop and line == each.line + each.who and text.search(data):
                yield f"{_said(each, 1)}: typed at {each.typed:.3f}, stop at {stop:.3f}, written at {at:.3f}"


def _first(world: World) -> Iterator[str]:
    """What leaves next on a line that can be written is its stop, after the rest of a message that must leave whole."""
    for stop in world.history.stops:
        for line, forms in stop.forms.items():
            after = [(at, data) for at, port, data in world.history.written if port == line and at >= stop.at]
            if after and after[0][0] <= stop.at + SOON:
                begun = b"".join(data for at, data in after if at <= stop.at + SOON)
                begun = begun[stop.rests[line] :]
                if not any(form.startswith(begun) or begun.startswith(form) for form in forms):
                    yield f"{line}: stop at {stop.at:.6f}, {begun!r} left at {after[0][0]:.6f}"


def _true(world: World) -> Iterator[str]:
    yield from world.history.untrue


def _ends(world: World) -> Iterator[str]:
    yield from world.history.defects


RULES = (
    Rule("twice", "No command is executed twice.", "Nothing is sent twice", _once),
    Rule("denied", "What was said to be not sent, or refused, was not executed.", "What is said is true", _unsent),
    Rule("lost", "What was said to be done was executed.", "What is said is true", _done),
    Rule("after a stop", "Nothing that was typed before a stop leaves after it.", "The stop", _nothing_before),
    Rule("first", "What leaves next on a line that can be written is its stop.", "The stop", _first),
    Rule("stopped", "A drive that is said to be stopped does not move.", "What is said is true", _true),
    Rule("ends", "Every wait ends; no task and no thread is left.", "Ends", _ends),
)


def broken(world: World) -> list[tuple[Rule, str]]:
    """Every breach."""
    return [(rule, text) for rule in RULES for text in rule.check(world)]
