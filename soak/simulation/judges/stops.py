"""Rules of the stop key: what leaves next on each line, and that every drive is sent its stop."""

from __future__ import annotations

import os.path
import re
from collections.abc import Collection, Iterator

from multidrop.transports.relay import GarbledFrame, Kind, frame
from soak.languages import LANGUAGES
from soak.simulation.judges.departures import for_drives, stop_bytes, under_way
from soak.simulation.judges.rule import Grant, Granted, Lived, Rule
from soak.simulation.records.history import Stop

SOON = 0.05
"""The time, s, in which the kernel takes a stop: a line that takes nothing meanwhile is lost, or flooded."""
SECOND = 1.0
DROP = frame(Kind.DROP)
CONTROL = re.compile(rb"(?:[PX]\0\0)*(?:[PX]\0?\Z)?")
"""Drops and signs of life of a relay, of which the last may not have left whole."""
FULL = Grant("a port that takes nothing", "A port that takes nothing")


def _first(life: Lived) -> Iterator[str | Granted]:
    """What leaves next on a line that can be written is its stop, after the rest of a message that must leave whole.

    It leaves at once, whatever the loop does, unless the line is found to be lost.
    """
    history = life.history
    for number, stop in enumerate(history.stops):
        killed = not stop.who and any(stop.at <= at <= stop.at + SOON for at in history.deaths)
        for line, forms in {} if killed else stop.forms.items():
            first, rest = stop.own[line]  # the rest of a message that leaves whole; other rests are dropped
            if under_way(life, line, stop):
                continue  # it goes on, as the rule of every drive says
            after = [(at, data) for at, port, data in history.written[first:] if port == line]
            if not after or after[0][0] > stop.at + SOON:
                again = any(name == line and at >= stop.at for at, name, _ in history.opened)
                if not (again or _lost(life, line, stop)):
                    left = f"nothing left before {after[0][0]:.3f}" if after else "nothing left"
                    words = f"{line}: stop at {stop.at:.6f}, {left}"
                    full = any(name == line and stop.at <= at <= stop.at + SOON for at, name in history.full)
                    yield Granted(FULL, words) if full else words
            else:
                following = (other.own[line][0] for other in history.stops[number + 1 :] if line in other.own)
                ends = next((at for at in following if at > first), None)  # where the next stop drops the rest of it
                own = [(at, data) for at, port, data in history.written[first:ends] if port == line]
                begun = b"".join(data for at, data in own if at <= stop.at + SOON)
                begins = [begun, begun[rest:]]
                if len(begun) <= rest:  # nothing of what follows the message has left so soon, or its rest was dropped
                    whole = b"".join(data for _, data in after)
                    begins = [begun, whole, whole[rest:]]
                begins = [each for each in begins if each]
                if life.place(line[:2]).kind == "ssh":
                    begins = [*_behind_one_drop(life, line, first, begins)]
                    if any(_begins_with_a_stop(life, line, each) for each in begins):
                        continue  # one of a stop before it that the far end had not taken: the next follows it
                if not any(_begins(each, form, forms) for form in forms for each in begins):
                    yield f"{line}: stop at {stop.at:.6f}, {begun!r} left at {after[0][0]:.6f}"


def _every_drive(life: Lived) -> Iterator[str | Granted]:
    """Whatever the loop does. What has left of a stop that was under way counts, too."""
    history = life.history
    for stop in history.stops:
        until = stop.at + SECOND
        ends = (*history.deaths, *history.began)
        if not stop.who and any(stop.at <= at <= until for at in ends):
            continue
        for line, drives in stop.reaches.items():
            till = max(until, _back(life, line, stop))
            again = any(name == line and stop.at <= at <= till for at, name, _ in history.opened)
            if again or _lost(life, line, stop):
                continue
            left = stop_bytes(life, line, stop, until)
            for drive in (drive for drive, reached in drives.items() if not reached(left)):
                words = f"{line}: stop at {stop.at:.6f}, nothing of it for {drive}, {left!r} left"
                full = any(name == line and stop.at <= at <= until for at, name in history.full)
                yield Granted(FULL, words) if full else words


def _begins(left: bytes, form: bytes, forms: Collection[bytes]) -> bool:
    """Whether what left begins with a form of a stop, of which another one (`/stop`) may cut off what is not sent."""
    if form.startswith(left) or left.startswith(form):
        return True
    cut = len(os.path.commonprefix([form, left]))
    return cut > 0 and any(left.startswith(each, cut) or each.startswith(left[cut:]) for each in forms)


def _begins_with_a_stop(life: Lived, line: str, left: bytes) -> bool:
    """Whether the first message for the drives, to a relay, is a stop."""
    place = life.place(line[:2])
    try:
        return bool(re.match(LANGUAGES[place.language].stop, for_drives(place.kind, left)))
    except GarbledFrame:  # the rest of a message that had begun to leave
        return False


def _behind_one_drop(life: Lived, line: str, first: int, begins: list[bytes]) -> Iterator[bytes]:
    """What leaves behind the drops of the stops before, of which nothing else has left: one drop is enough for all."""
    before = b"".join(data for _, port, data in life.history.written[:first] if port == line)
    for whole in (*begins, *(DROP + each for each in begins if before.endswith(DROP))):
        control = CONTROL.match(whole)
        assert control is not None
        yield DROP * (DROP[:1] in control[0]) + whole[control.end() :]


def _lost(life: Lived, line: str, stop: Stop) -> bool:
    """Whether a session says after a stop that a line was lost."""
    said = re.compile(rf"{line[:2]}: .* was lost|{line[:2]}: .*; trying again")
    return any(at >= stop.at and said.match(text) for at, text in life.history.notices)


def _back(life: Lived, line: str, stop: Stop) -> float:
    """When a line that was lost before a stop is said to be back after it; 0 where it was not lost."""
    said = f"{line[:2]} is back after"
    return next((at for at, text in life.history.notices if at >= stop.at and text.startswith(said)), 0.0)


PROMISE = "What a stop promises"
STOPS = (
    Rule("first", "What leaves next on a line that can be written is its stop, at once.", PROMISE, _first, (FULL,)),
    Rule(
        "every drive",
        "Within a second of the key every drive of every open line has been sent its stop.",
        PROMISE,
        _every_drive,
        (FULL,),
    ),
)
