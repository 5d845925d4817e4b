"""Rules whose breaches are noted in the life itself: as a drive is said to stand, as a session ends, and after it."""

from __future__ import annotations

import re
from collections.abc import Iterator

from soak.simulation.judges.outcomes import ASTRAY, BARE_COMMAND, arrived_late, became
from soak.simulation.judges.rule import Grant, Granted, Lived, Rule


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


REPORT = "What a report means"
NOTED = (
    Rule("stopped", "A drive that is said to be stopped does not move.", "What a stop promises", _true),
    Rule("ends", "Every wait ends; no task, thread, file, lock or defect is left.", REPORT, _ends),
    Rule("files", "A session reads every file that the one before has left.", REPORT, _readable),
    Rule("shown", "What the terminal does not show is counted there.", "0013", _shown),
    Rule(
        "restored",
        "A setting that a session has borrowed from a drive is restored by it, or by the next one.",
        REPORT,
        _restored,
        (SAID, ASTRAY, BARE_COMMAND),
    ),
    Rule("bounded", "What waits in a session is bounded.", REPORT, _bounded),
    Rule("log", "A session log breaks no rule of `log judge`.", REPORT, _logged),
)
