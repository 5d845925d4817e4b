"""Rules of what leaves, on which connection: after a stop, after a loss, and once a lost line is back."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf

from multidrop.transports import telnet
from multidrop.transports.relay import FrameSplitter, GarbledFrame, Kind
from soak.languages import LANGUAGES
from soak.simulation.judges.rule import Lived, Rule
from soak.simulation.records.commands import Command
from soak.simulation.records.history import Stop

WHOLE = 20
"""Bytes of a connection that are enough to see what it began with."""


@dataclass(frozen=True)
class Connection:
    """One opening of a line, and what left on it for the drives."""

    at: float
    line: str
    data: bytes


def _connections(life: Lived, since: int = 0) -> Iterator[Connection]:
    """Every connection of every line, in their order, with what left from a write on."""
    history = life.history
    places = {each.name: each for each in life.places}
    for number, (at, line, begins) in enumerate(history.opened):
        ends = next((index for _, other, index in history.opened[number + 1 :] if other == line), None)
        left = history.written[begins:ends]
        whole, before = (  # a message may have begun to leave
            for_drives(places[line[:2]].kind, b"".join(data for _, port, data in part if port == line))
            for part in (left, left[: max(0, since - begins)])
        )
        yield Connection(at, line, whole[len(before) :])


def for_drives(kind: str, left: bytes) -> bytes:
    """Those bytes of a connection that are for the drives."""
    if kind == "rfc2217":
        return b"".join(each.data for each in telnet.Decoder().receive(left) if isinstance(each, telnet.Data))
    if kind == "ssh":
        return b"".join(payload for each, payload in FrameSplitter().take(left) if each is Kind.DATA)
    return left


def _words(command: Command) -> str:
    where = f"{command.line}:{command.drive} {command.text!r}: {command.outcome.value} ({command.said})"
    return f"{where}, typed at {command.typed:.3f}"


def _left(life: Lived, command: Command, data: bytes) -> bool:
    return LANGUAGES[life.place(command.line).language].carries(data, command.text)


def _nothing_before(life: Lived) -> Iterator[str]:
    """Bytes of a command that was typed before a stop leave after it."""
    history, after = life.history, dict[tuple[int, str], bytes]()
    for each in history.commands.values():
        stops = [stop for stop in history.stops if stop.who == each.who]
        if each.stops >= len(stops):
            continue
        stop, line = stops[each.stops], each.line + each.who
        key = stop.own[line][0] if line in stop.own else stop.done, line
        if key not in after:
            left = b"".join(data for _, port, data in history.written[key[0] :] if port == line)
            after[key] = left.replace(b"\xff\xff", b"\xff") if life.place(each.line).kind == "rfc2217" else left
        if _left(life, each, after[key]):
            yield f"{_words(each)}, stop at {stop.at:.3f}, written after it"


def _after_a_quit(life: Lived) -> Iterator[str]:
    """Bytes of a command that was typed after an accepted quit leave, or a drive executes it."""
    history = life.history
    for quit_ in (each for each in history.told.quits if each.accepted < inf):
        for each in quit_.after:
            line = each.line + each.who
            left = b"".join(data for at, port, data in history.written if port == line and at >= quit_.at)
            left = left.replace(b"\xff\xff", b"\xff") if life.place(each.line).kind == "rfc2217" else left
            key = each.line, each.drive, each.text
            if _left(life, each, left) or any((one.line, one.drive, one.text) == key for one in history.executed):
                yield f"{_words(each)}, behind a quit that was accepted at {quit_.accepted:.3f}"


def _never_again(life: Lived) -> Iterator[str]:
    """The bytes of a command leave on two connections."""
    connections = [*_connections(life)]
    for each in life.history.commands.values():
        line = each.line + each.who
        times = [known.at for known in connections if known.line == line and _left(life, each, known.data)]
        if len(times) > 1:
            yield f"{_words(each)}, left on the connections of {', '.join(f'{at:.3f}' for at in times)}"


def _owed(life: Lived) -> Iterator[str]:
    """A line that was lost at a stop is back, and something else leaves first. An ended session owes nothing."""
    history = life.history
    for stop in history.stops:
        ends = [at for at in (*history.deaths, *history.began) if at >= stop.at and not stop.who]
        until = min(ends, default=inf)
        for line in stop.lost:
            if line in stop.own:
                continue  # it was back as its thread came to it, which wrote the stop
            since = _connections(life, stop.written)  # one that was just being made may carry it
            first = next((each for each in since if each.line == line and each.at <= until and each.data), None)
            form = re.compile(LANGUAGES[life.place(line[:2]).language].stop)
            if first is not None and len(first.data) >= WHOLE and not form.match(first.data):
                yield f"{line}: stop at {stop.at:.3f}, back at {first.at:.3f} with {first.data[:WHOLE]!r}"


def _repeated(life: Lived) -> Iterator[str]:
    """Each piece of a stop leaves again, unless another stop, a loss or an end comes before the line was quiet."""
    history = life.history
    for stop in history.stops:
        ends = (*history.deaths, *history.told.halts, *(each.at for each in history.stops if each is not stop))
        for line, pieces in stop.pieces.items():
            first = stop.own[line][0]
            begins = next(
                (index for index in range(first, len(history.written)) if history.written[index][1] == line), -1
            )
            again = any(name == line and at >= stop.at for at, name, _ in history.opened)
            lost = any(at >= stop.at and LOST.match(text) for at, text in history.notices)
            if begins < 0 or again or lost or any(at > stop.at + TAKEN_OVER for at in ends):
                continue
            begins += not under_way(life, line, stop)
            left = _written(life, line, begins, len(history.written))
            yield from (
                f"{line}: stop at {stop.at:.3f}, {each!r} did not leave again" for each in pieces if each not in left
            )


def _written(life: Lived, line: str, index: int, till: int = 0) -> bytes:
    """What writes have brought the drives of a line: a message of a network may be in several of them.

    They are the one of a number, or all from that on, up to the one before `till`.
    """
    history, kind, till = life.history, life.place(line[:2]).kind, till or index + 1
    first = max((begins for _, name, begins in history.opened if name == line and begins <= index), default=0)
    whole, before = (
        b"".join(data for _, name, data in history.written[first:end] if name == line) for end in (till, index)
    )
    try:
        return for_drives(kind, whole)[len(for_drives(kind, before)) :]
    except GarbledFrame:  # bytes are no frames where a session before has left half of one
        return whole[len(before) :]


def under_way(life: Lived, line: str, stop: Stop) -> bool:
    """Whether a person's stop before it is on its way to the drives: then this one goes on with that.

    A stop that was owed to a lost line, and left as it came back, is one, and `/stop` is. That of an automation, of
    some drives, is none.
    """
    before = (
        _after_a_loss(life, line, stop)
        or any(stop.at - STILL <= at <= stop.at and TYPED.match(text) for at, text in life.history.notices)
        or any(
            each is not stop
            and each.at <= stop.at
            and (line in each.lost or each.at >= stop.at - STILL or _nothing_else(life, line, each, stop))
            for each in life.history.stops
        )
    )
    stops = [each for each in life.history.stops if stop.at - STILL <= each.at <= stop.at and line in each.own]
    earlier = stops[: stops.index(stop)]
    begins = earlier[-1].own[line][0] if earlier else 0
    for index in range(stop.own[line][0] - 1, begins - 1, -1):
        at, name, _ = life.history.written[index]
        if at < stop.at - STILL:
            break
        if name == line and (left := _written(life, line, index)):
            # Its forms were made when it came: what was half sent then may have left since.
            known = before and any(_is_stop(each, line, left) for each in (stop, *earlier))
            return known or _of_an_opening(life, line, stop, left)
    return bool(earlier)  # nothing of it has left yet


def _after_a_loss(life: Lived, line: str, stop: Stop) -> bool:
    """Whether a line got a stop that it was owed, right before this one: it had been lost, and is said to have got one.

    That is said at the first connection; each one that follows, until the line is back, begins with the stop.
    """
    history, said = life.history, re.compile(rf"{line[:2]}: the stop of .* was sent first")
    owed = [at for at, text in history.notices if at <= stop.at and said.match(text)]
    opened = any(name == line and stop.at - STILL <= at <= stop.at for at, name, _ in history.opened)
    return bool(owed) and (opened or owed[-1] >= stop.at - STILL)


def _nothing_else(life: Lived, line: str, before: Stop, stop: Stop) -> bool:
    """Whether nothing but parts of a stop has left between two: with many motors it takes seconds."""
    if line not in before.own:
        return False
    between = range(before.own[line][0], stop.own[line][0])
    mine = (index for index in between if life.history.written[index][1] == line)
    lefts = filter(None, (_written(life, line, index) for index in mine))
    return all(_is_stop(before, line, left) or _is_stop(stop, line, left) for left in lefts)


def _of_an_opening(life: Lived, line: str, stop: Stop, left: bytes) -> bool:
    """Whether what left is the stop of a key that came as the line was being opened, with no drives known yet."""
    keys = [each for each in life.history.stops if stop.at - STILL <= each.at < stop.at and each.who == stop.who]
    opening = any(line not in each.forms and line not in each.lost for each in keys)
    return opening and re.search(LANGUAGES[life.place(line[:2]).language].stop, left) is not None


def _is_stop(stop: Stop, line: str, left: bytes) -> bool:
    """Whether what left is of a stop, or a part of one."""
    return any(left.endswith(each) or left in each for each in stop.parts[line])


def stop_bytes(life: Lived, line: str, stop: Stop, until: float) -> bytes:
    """What has left for the drives of a line from a stop on, and before it as far as that was a stop, too."""
    history, place = life.history, life.place(line[:2])
    first = max((index for at, name, index in history.opened if name == line and at <= stop.at), default=0)
    begins = stop.own[line][0]
    for index in range(begins - 1, first - 1, -1):
        at, name, _ = history.written[index]
        if name == line:
            left = _written(life, line, index)
            if at < stop.at - UNDER_WAY or (left and not _is_stop(stop, line, left)):
                break
            begins = index
    whole, before = (
        b"".join(data for at, name, data in history.written[first:end] if name == line and at <= until)
        for end in (None, begins)
    )
    try:
        return for_drives(place.kind, whole)[len(for_drives(place.kind, before)) :]
    except GarbledFrame:
        return whole[len(before) :]


TYPED = re.compile(r"(?!Ctrl\+X)\S+: stop (?:not )?sent to every drive")
"""What is said of a stop that came by no key, such as `/stop`."""
STILL = 2.0
"""The time, s, in which a stop may still be on its way, although the loop has written nothing since."""
UNDER_WAY = 0.2
"""The longest time, s, between two pieces of a stop, but for the pause before its repetition."""
LOST = re.compile(r"l\d: .* was lost|l\d: .*; trying again")
TAKEN_OVER = 1e-9
"""The time in which the loop has taken over a stop, at the time of its key, s."""
PROMISE = "What a stop promises"
DEPARTURES = (
    Rule("after a stop", "Nothing that was typed before a stop leaves after it.", PROMISE, _nothing_before),
    Rule("quit", "Nothing that is typed after an accepted quit leaves.", PROMISE, _after_a_quit),
    Rule("repeated", "A stop leaves again, piece by piece, once its line is quiet.", PROMISE, _repeated),
    Rule("sent again", "No command leaves again on another connection.", "What is never done twice", _never_again),
    Rule("owed", "What leaves first on a line that was lost at a stop is the stop.", PROMISE, _owed),
)
