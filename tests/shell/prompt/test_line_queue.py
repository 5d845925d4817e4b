"""Lines at the prompt wait for their turn; a failure or a stop holds back the rest, which is shown."""

import asyncio
from typing import Any

import pytest

from multidrop.base.errors import Refused
from multidrop.shell.line_syntax import Place, TypedLine
from multidrop.shell.prompt.line_queue import BURST, MOST_SHOWN_UNSENT, LineQueue

pytestmark = pytest.mark.virtual


class FakeSession:
    """Runs a line for a second; `bad` fails."""

    def __init__(self) -> None:
        self.stops = 0
        self.place, self.buses, self.quitting = Place("", ""), dict[str, object](), False
        self.done: list[str] = []
        self.started: list[str] = []
        self.notices: list[str] = []

    def now(self) -> float:
        return asyncio.get_running_loop().time()

    async def run(self, line: TypedLine, origin: object, since: int) -> None:
        await asyncio.sleep(1.0)
        if line.typed == "bad":
            raise Refused("bad")
        self.done.append(line.typed)

        if line.typed == "/use eth":
            self.place = Place("eth", "")
        if line.typed == "/close press":
            del self.buses["press"]
            self.place = Place("eth", "")
        if line.typed == "/quit":
            self.quitting = True

    def start(self, line: TypedLine, since: int) -> None:
        self.started.append(line.typed)

    def notify(self, text: str, warning: bool = False) -> None:
        self.notices.append(text)


class Typist:
    """`async with`: a queue at work."""

    def __init__(self) -> None:
        self.session: Any = FakeSession()
        self.queue = LineQueue(self.session)

    async def __aenter__(self) -> "Typist":
        self._work = asyncio.create_task(self.queue.run())
        return self

    async def __aexit__(self, *_: object) -> None:
        self.queue.close()
        self._work.cancel()
        await asyncio.gather(self._work, return_exceptions=True)


@pytest.fixture
async def typist():
    async with Typist() as made:
        yield made


async def test_lines_run_one_after_the_other(typist):
    typist.queue.enter("MR 1\nMR 2")
    await asyncio.sleep(1.5)
    assert typist.session.done == ["MR 1"] and typist.queue.running == "MR 2"
    await asyncio.sleep(1.0)
    assert typist.session.done == ["MR 1", "MR 2"] and typist.queue.running == ""


async def test_a_text_with_a_hidden_line_is_not_sent_and_a_paste_with_cr_has_lines(typist):
    for text in ("PR P\u2028MR 1", "PR P\x0bMR 1\nMR 2", "# x\rMR 1\nMR 2", "PR P\x85MR 1"):
        typist.queue.enter(text)
    await asyncio.sleep(3.0)
    assert typist.session.done == [] and len(typist.session.notices) == 4
    assert typist.session.notices[0].startswith("line 1: line separator (U+2028)")
    typist.queue.enter("MR 1\rMR 2")
    await asyncio.sleep(3.0)
    assert typist.session.done == ["MR 1", "MR 2"]


async def test_a_failed_line_holds_back_the_rest_of_its_burst_only(typist):
    typist.queue.enter("bad\nMR 1")
    for line in ("MR 2", "MR 3"):
        await asyncio.sleep(BURST * 0.9)
        typist.queue.enter(line)
    await asyncio.sleep(BURST * 0.9)
    typist.queue.enter("MR 4")
    assert typist.session.notices == [f"not sent, as 'bad' failed: MR {n}" for n in (1, 2, 3, 4)]
    await asyncio.sleep(BURST * 1.1)
    typist.queue.enter("MR 5")
    await asyncio.sleep(2.0)
    assert typist.session.done == ["MR 5"]


async def test_lines_that_had_come_before_a_failure_are_held_back_however_slow_this_program_is(typist):
    typist.queue.enter("bad", followed=True)
    await asyncio.sleep(BURST * 3)
    typist.queue.enter("MR 1", followed=True)
    await asyncio.sleep(BURST * 3)
    typist.queue.enter("MR 2")
    await asyncio.sleep(BURST * 3)
    typist.queue.enter("MR 3")
    await asyncio.sleep(2.0)
    assert typist.session.notices == [f"not sent, as 'bad' failed: MR {n}" for n in (1, 2)]
    assert typist.session.done == ["MR 3"]


async def test_a_stop_drops_what_waits_and_takes_new_lines(typist):
    typist.queue.enter("MR 1\nMR 2")
    await asyncio.sleep(0.1)
    typist.session.stops += 1
    typist.queue.stopped()
    typist.queue.enter("MR 3")
    await asyncio.sleep(3.0)
    assert typist.session.notices == ["not sent, as a stop came: MR 2"]
    assert typist.session.done == ["MR 1", "MR 3"]  # the session ends the running line; this one's fake does not


async def test_a_line_that_a_stop_ended_holds_back_nothing_typed_after_that_stop(typist):
    typist.queue.enter("bad")
    await asyncio.sleep(0.1)
    typist.session.stops += 1
    typist.queue.stopped()
    typist.queue.enter("MR 1")
    await asyncio.sleep(3.0)
    assert (typist.session.done, typist.session.notices) == (["MR 1"], [])


async def test_stop_and_quit_wait_for_no_line_and_a_macro_for_those_of_its_burst_only(typist):
    for line in ("MR 1", "/play m", "/stop", "/quit"):
        typist.queue.enter(line)
    assert typist.session.started == ["/stop", "/quit"]
    assert typist.queue.count == 3  # /quit does not count
    await asyncio.sleep(0.9)
    typist.queue.enter("/play n")
    assert typist.session.started == ["/stop", "/quit", "/play n"]
    await asyncio.sleep(0.2)
    assert (typist.session.done, typist.session.started[3:]) == (["MR 1"], ["/play m"])


async def test_of_many_lines_the_first_are_shown_and_the_rest_counted():
    typist = Typist()
    typist.queue.show_unsent("a stop came", [f"MR {n}" for n in range(MOST_SHOWN_UNSENT + 7)] + ["  "])
    assert len(typist.session.notices) == MOST_SHOWN_UNSENT + 1
    assert typist.session.notices[-1] == "7 more lines were not sent"


async def test_what_is_entered_while_buses_open_waits_for_them_but_stop_and_quit(typist):
    typist.queue.opening = True
    for line in ("/play m", "/stop", "/quit"):
        typist.queue.enter(line)
    assert typist.session.started == ["/stop", "/quit"]
    typist.queue.opening = False
    await asyncio.sleep(0.01)
    assert typist.session.started == ["/stop", "/quit", "/play m"]


def two_buses(typist):
    typist.session.place = Place("press", "a")
    typist.session.buses = {"press": object(), "eth": object()}


@pytest.mark.parametrize("together", [True, False], ids=["one paste", "a burst"])
async def test_a_line_entered_before_a_bus_was_closed_goes_to_no_other_bus(typist, together):
    two_buses(typist)
    lines = ["/close press", "SL 200000", "@a MR 5", "@eth: PR P"]
    for text in ["\n".join(lines)] if together else lines:
        typist.queue.enter(text)
    await asyncio.sleep(5.0)
    assert typist.session.done == ["/close press", "@eth: PR P"]
    assert typist.session.notices == [f"not sent, as press was closed: {line}" for line in ("SL 200000", "@a MR 5")]
    typist.queue.enter("PR V")
    await asyncio.sleep(2.0)
    assert typist.session.done[-1] == "PR V", "typed for the bus that is selected now"


async def test_a_line_behind_a_use_is_for_what_it_selects_also_once_the_bus_before_is_closed(typist):
    two_buses(typist)
    typist.queue.enter("/use eth\n/close press\nPR P")
    await asyncio.sleep(5.0)
    assert typist.session.done == ["/use eth", "/close press", "PR P"] and typist.session.notices == []


async def test_a_paste_is_sent_as_far_as_its_quit_and_the_rest_is_named(typist):
    typist.queue.enter("PR P\n/quit\nSL 200000\nMR 5")
    await asyncio.sleep(5.0)
    typist.queue.enter("MR 7")
    assert (typist.session.done, typist.session.started) == (["PR P", "/quit"], [])
    assert typist.session.notices == [
        f"not sent, as multidrop is ending: {line}" for line in ("SL 200000", "MR 5", "MR 7")
    ]


async def test_while_a_quit_is_decided_nothing_is_sent_and_what_is_entered_is_named(typist):
    typist.queue.enter("PR P")
    await asyncio.sleep(0.6)
    typist.queue.enter("MR 1")
    with typist.queue.deciding():
        await asyncio.sleep(3.0)
        typist.queue.enter("SL 200000\n/stop\n/quit")
    assert typist.session.done == ["PR P"] and typist.session.started == ["/stop"]
    await asyncio.sleep(3.0)
    assert typist.session.done == ["PR P", "MR 1"], "it was typed before the quit, which was declined"
    assert typist.session.notices == [
        f"not sent, as it was typed after a quit: {line}" for line in ("SL 200000", "/quit")
    ]
