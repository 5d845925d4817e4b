"""Typed lines: their order and waiting, and the report of unsent ones. Time is virtual."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from multidrop.shell.origin import PERSON
from multidrop.tui.outbox import BURST, Outbox
from tests.support.fake_session import FakeSession, demo_session

pytestmark = pytest.mark.virtual

LATER = BURST + 0.1


class Box:
    """An outbox over a small session; each line takes as many seconds as `takes` gives."""

    def __init__(self, **takes: float) -> None:
        self.session: FakeSession = demo_session()
        self.takes = {name.replace("_", " "): seconds for name, seconds in takes.items()}
        self.told: list[str] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self.outbox = Outbox(self.session, self.told.append, self._watch)
        run = self.session.run

        async def slow(line: str, origin: object = None, since: int | None = None) -> None:
            await run(line, PERSON, since)
            await asyncio.sleep(next((s for word, s in self.takes.items() if word in line), 0.0))

        self.session.run = slow  # type: ignore[method-assign]

    def _watch(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)

    async def type(self, *lines: str, apart: float = 0.01) -> None:
        for line in lines:
            self.outbox.type(line)
            await asyncio.sleep(apart)

    @property
    def sent(self) -> list[str]:
        return self.session.sent


async def test_lines_of_a_burst_are_sent_each_when_the_one_before_was_answered() -> None:
    box = Box(MR=1.0)
    await box.type("MR 1", "MR 2", "@b PR P", "PR V")
    assert box.sent == ["press:a MR 1"]
    assert box.outbox.waiting == 3
    await asyncio.sleep(1.5)
    assert box.sent == ["press:a MR 1", "press:a MR 2"]
    await asyncio.sleep(1.5)
    assert box.sent[2:] == ["press:a @b PR P", "press:a PR V"]
    assert box.outbox.idle


async def test_lines_that_had_come_before_a_failure_are_held_back_however_slow_this_program_is() -> None:
    box, waiting = Box(), ["BAD", "MR 1"]
    box.session.refuses["BAD"] = "a: 20 unknown"
    box.outbox.follows = lambda: bool(waiting)
    await box.type("BAD", apart=LATER)
    waiting.clear()
    await box.type("MR 1", apart=LATER)
    assert box.sent == ["press:a BAD"]
    await asyncio.sleep(LATER)
    assert box.told == ["'BAD' failed; not sent: MR 1; /unsent offers it again"]
    await box.type("MR 2")
    assert box.sent[1:] == ["press:a MR 2"]


async def test_what_a_person_types_while_a_wait_goes_on_is_answered_at_once() -> None:
    box = Box(**{"/wait": 60.0})
    await box.type("/wait stopped 60", "PR P", apart=LATER)
    assert box.sent == ["press:a /wait stopped 60", "press:a PR P"]
    await box.type("/wait stopped 60", "MR 5")
    assert box.sent[2:] == ["press:a /wait stopped 60"], "in one go it is a sequence"


async def test_a_line_for_a_bus_that_has_not_answered_waits_however_slowly_it_is_typed() -> None:
    box = Box(MR=3.0)
    await box.type("MR 1", "MR 2", "@eth: PR P", apart=LATER)
    assert box.sent == ["press:a MR 1", "press:a @eth: PR P"]
    await asyncio.sleep(3)
    assert box.sent[2:] == ["press:a MR 2"]


async def test_the_first_refused_line_holds_the_rest_and_what_still_comes_of_the_burst() -> None:
    box = Box()
    box.session.refuses["BAD"] = "a: 20 unknown"
    await box.type("MR 1", "BAD", "MR 2", "MR 3")
    await asyncio.sleep(BURST / 2)
    await box.type("MR 4")
    assert box.told == []
    await asyncio.sleep(LATER)
    assert box.sent == ["press:a MR 1", "press:a BAD"]
    assert box.told == ["'BAD' failed; 3 lines were not sent: MR 2 · MR 3 · MR 4; /unsent offers them again"]
    await box.type("MR 5")
    assert box.sent[2:] == ["press:a MR 5"], "a person has seen it"


async def test_a_refusal_drops_what_was_waiting_when_it_came() -> None:
    box = Box(BAD=2.0)
    box.session.refuses["BAD"] = "a: no answer"
    run = box.session.run

    async def refused_late(line: str, origin: object = None, since: int | None = None) -> None:
        await asyncio.sleep(2.0 if line == "BAD" else 0.0)
        await run(line, PERSON, since)

    box.session.run = refused_late  # type: ignore[method-assign]
    await box.type("BAD", "MR 2", apart=LATER)
    await asyncio.sleep(2 + LATER)
    assert box.sent == ["press:a BAD"]
    assert box.told == ["'BAD' failed; not sent: MR 2; /unsent offers it again"]


async def test_a_stop_drops_what_waits_and_what_comes_then_follows_nothing() -> None:
    box = Box(MR=1.0)
    await box.type("MR 1", "MR 2", "MR 3")
    box.session.stop()
    box.outbox.drop()
    await box.type("PR P")
    assert box.sent == ["press:a MR 1", "press:a PR P"]
    assert box.told == ["stopped; 2 lines were not sent: MR 2 · MR 3; /unsent offers them again"]
    await asyncio.sleep(10)
    assert len(box.sent) == 2
    assert len(box.told) == 1


async def test_a_line_carries_the_count_of_stops_of_its_enter() -> None:
    box = Box()
    typed: list[int | None] = []
    box.session.start = note(typed, box.session.start)  # type: ignore[method-assign]
    box.session.stops = 3
    await box.type("MR 1")
    assert typed == [3]


def note(typed: list[int | None], start: Callable[..., Any]) -> Callable[..., Any]:
    def noting(line: str, origin: object = None, since: int | None = None) -> Any:
        typed.append(since)
        return start(line, PERSON, since)

    return noting


async def test_a_line_goes_to_the_drive_that_was_selected_as_it_was_typed() -> None:
    box = Box(MR=1.0)
    await box.type("MR 1", "MR 2", "@b MR 3", "@eth: PR P")
    box.session.select("", "eth")
    await asyncio.sleep(5)
    assert [line.partition(" ")[2] for line in box.sent] == ["MR 1", "@press:a MR 2", "@press:b MR 3", "@eth: PR P"]


async def test_a_verb_is_held_where_it_would_be_for_another_drive() -> None:
    box = Box(MR=1.0)
    await box.type("MR 1", "/list", "MR 2")
    box.session.select("b", "press")
    await asyncio.sleep(5)
    assert box.sent == ["press:a MR 1"]
    assert box.told == [
        "another drive was selected than press:gantry; 2 lines were not sent: /list · MR 2; /unsent offers them again"
    ]


async def test_lines_behind_a_use_are_for_what_it_selects() -> None:
    box = Box(MR=1.0)
    await box.type("MR 1", "/use eth", "MR 2")
    await asyncio.sleep(5)
    assert box.sent == ["press:a MR 1", "eth: /use eth", "eth: MR 2"]


async def test_quit_waits_for_nothing() -> None:
    box = Box(MR=9.0)
    await box.type("MR 1", "MR 2", "/quit")
    assert box.sent == ["press:a MR 1", "press:a /quit"]


async def test_a_second_paste_does_not_mix_with_the_first() -> None:
    box = Box(MR=1.0)
    box.outbox.paste(["MR 1", "MR 2"])
    await asyncio.sleep(0.1)
    box.outbox.paste(["PG 1", "PG"])
    await asyncio.sleep(5)
    assert [line.partition(" ")[2] for line in box.sent] == ["MR 1", "MR 2", "PG 1", "PG"]


async def test_a_line_that_cannot_be_read_holds_the_rest_too() -> None:
    box = Box()
    box.session.refuses["@"] = "no address after the @"
    await box.type("@", "MR 2")
    await asyncio.sleep(LATER)
    assert box.sent == ["press:a @"]
    assert box.told == ["'@' failed; not sent: MR 2; /unsent offers it again"]


async def test_of_five_hundred_pasted_lines_the_rest_after_a_failure_is_offered_again() -> None:
    box = Box()
    box.session.refuses["MR 250"] = "a: 20 unknown"
    box.outbox.paste([f"MR {n}" for n in range(500)])
    await asyncio.sleep(1)
    assert len(box.sent) == 251
    assert box.told == [
        "'MR 250' failed; 249 lines were not sent: MR 251 · MR 252 · MR 253 · MR 254 …; /unsent offers them again"
    ]
    box.session.select("b")
    again = box.outbox.unsent_lines()
    assert (len(again), again[0], again[-1]) == (249, "@press:a MR 251", "@press:a MR 499"), "for the drive that was"
    box.session.refuses.clear()
    box.outbox.paste_again(again)
    assert box.outbox.unsent_lines() == [], "nothing is offered twice"
    await asyncio.sleep(1)
    assert len(box.sent) == 500


async def test_a_stop_in_the_middle_of_a_paste_offers_the_rest_but_not_the_line_that_was_sent() -> None:
    box = Box(MR=0.1)
    box.outbox.paste([f"MR {n}" for n in range(500)])
    await asyncio.sleep(1.05)
    sent = len(box.sent)
    box.session.stop()
    box.outbox.drop()
    await asyncio.sleep(5)
    assert len(box.sent) == sent
    assert box.outbox.unsent_lines() == [f"MR {n}" for n in range(sent, 500)]
