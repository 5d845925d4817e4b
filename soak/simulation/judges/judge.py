"""The judge: rules that hold in every history, each with a name, a sentence, and the place that promises it."""

from __future__ import annotations

import os.path
import re
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from multidrop.transports.relay import Garbled, Kind, frame
from soak.languages import LANGUAGES
from soak.simulation.judges.departures import DEPARTURES, for_drives, stop_bytes, under_way
from soak.simulation.judges.outcomes import ASTRAY, BARE_COMMAND, OUTCOMES, arrived_late, became
from soak.simulation.judges.promises import PROMISES
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
    except Garbled:  # the rest of a message that had begun to leave
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


def _bounded(life: Lived) -> Iterator[str]:
    """What was more than its bound."""
    for name, peak in life.history.peaks.items():
        if peak.seen > peak.most:
            yield f"{peak.seen} {name}, and not {peak.most} at most"


def _true(life: Lived) -> Iterator[str]:
    yield from life.history.untrue


def _shown(life: Lived) -> Iterator[str]:
    yield from life.history.unshown


def _readable(life: Lived) -> Iterator[str]:
    yield from life.history.unreadable


def _logged(life: Lived) -> Iterator[str]:
    yield from life.history.logged


SAID = Grant("a session that says that it cannot", "What a report means")


def _restored(life: Lived) -> Iterator[str | Granted]:
    said = re.compile(r"may be EM=0 now|the next one cannot repair this port")
    for found in life.history.owing:
        line, _, drive = found.partition(" ")[0].partition(":")
        silent = f"{line}: {drive} does not reply"  # what is owed to it is kept for the session after this one
        warned = any(line in text and said.search(text) for _, text in life.history.notices)
        asked = any(text == silent and at >= life.history.began[-1] for at, text in life.history.notices)
        own = [each for each in life.history.executed if (each.line, each.drive, each.text) == (line, drive, "EM=0")]
        grants = {
            ASTRAY: any(arrived_late(life, each) for each in own),
            BARE_COMMAND: bool(own) and became(life, line, own[-1].at),
            SAID: warned or asked,
        }
        grant = next((each for each, holds in grants.items() if holds), None)
        yield Granted(grant, found) if grant else found


def _ends(life: Lived) -> Iterator[str]:
    yield from life.history.defects


RULES = (
    *OUTCOMES,
    *PROMISES,
    *DEPARTURES,
    Rule(
        "first",
        "What leaves next on a line that can be written is its stop, at once.",
        "What a stop promises",
        _first,
        (FULL,),
    ),
    Rule(
        "every drive",
        "Within a second of the key every drive of every open line has been sent its stop.",
        "What a stop promises",
        _every_drive,
        (FULL,),
    ),
    Rule("stopped", "A drive that is said to be stopped does not move.", "What a stop promises", _true),
    Rule("ends", "Every wait ends; no task, thread, file, lock or defect is left.", "What a report means", _ends),
    Rule(
        "files",
        "A session reads every file that the one before has left.",
        "What a report means",
        _readable,
    ),
    Rule("shown", "What the terminal does not show is counted there.", "0013", _shown),
    Rule(
        "restored",
        "A setting that a session has borrowed from a drive is restored by it, or by the next one.",
        "What a report means",
        _restored,
        (SAID, ASTRAY, BARE_COMMAND),
    ),
    Rule("bounded", "What waits in a session is bounded.", "What a report means", _bounded),
    Rule("log", "A session log breaks no rule of `log judge`.", "What a report means", _logged),
)


@dataclass
class Judgement:
    """The breaches of one history, and the number of those that each grant excepts."""

    breaches: list[tuple[Rule, str]] = field(default_factory=list)
    granted: Counter[str] = field(default_factory=Counter)

    @property
    def rules(self) -> list[str]:
        """The names of the rules that broke, each once."""
        return list(dict.fromkeys(rule.name for rule, _ in self.breaches))


def judged(life: Lived) -> Judgement:
    """Judge a history by every rule."""
    judgement = Judgement()
    for rule in RULES:
        wrong = (each.words for each in life.history.told.facts if each.rule == rule.name and not each.holds)
        for found in (*wrong, *rule.check(life)):
            if isinstance(found, str):
                judgement.breaches.append((rule, found))
            else:
                assert found.grant in rule.grants, f"{rule.name} has no grant {found.grant.name!r}"
                judgement.granted[f"{rule.name}, but for {found.grant.name}"] += 1
    return judgement


def broken(life: Lived) -> list[tuple[Rule, str]]:
    """Every breach."""
    return judged(life).breaches
