"""Conversations in turn: ends, interruptions, defects and losses, each without a task of its own."""

import asyncio

import pytest

from multidrop.base.errors import Stopped, TransportLost
from multidrop.dialects import DriveState, Priority, Procedure, Reply, Request
from multidrop.dialects.state import Owed
from multidrop.drives.conversations import Conversations
from multidrop.drives.events import Notice, Sent
from multidrop.drives.line import Line
from multidrop.drives.link import Link
from multidrop.drives.port_journal import Keeper
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.transports import Transport

pytestmark = pytest.mark.virtual

CODEC = MCode(em=1)
REPLY_AFTER = 0.01


class Pipe(Transport):
    """A drive that prints 5 some time after each line."""

    name = "pipe"

    def __init__(self) -> None:
        self.written: list[bytes] = []
        self.silent = False

    def start(self, received, lost) -> None:
        self.received, self.lost = received, lost

    def write(self, data: bytes) -> bool:
        self.written.append(data)
        if not self.silent:
            asyncio.get_running_loop().call_later(REPLY_AFTER, self.received, b"\r\n5\r\n")
        return True

    def discard(self, whole: bool = False) -> int:
        return 0

    async def close(self) -> None:
        return None


class Desk:
    """Conversations with one drive on such a pipe."""

    def __init__(self, keeper: Keeper | None = None, codec: MCode = CODEC) -> None:
        keeper = keeper or Keeper()
        self.pipe = Pipe()
        self.link = Link("desk", self.pipe, Line(codec), keeper)
        self.conversations = Conversations(self.link, keeper)
        self.state = DriveState(codec)
        self.sent: list[str] = []
        self.link.watch(lambda event: self.sent.append(event.request.text) if isinstance(event, Sent) else None)
        self.link.start()

    def run(self, *texts: str, after: tuple[str, ...] = ()) -> asyncio.Task[str]:
        """Print in turn; if that fails, print what is `after`."""
        return asyncio.ensure_future(self.conversations.run(prints(texts, after, self.state.codec), self.state))

    def stop(self) -> None:
        """Stop everything."""
        self.conversations.stop(None)
        self.link.line.stop(self.link.now())
        self.link.advance()


def prints(texts: tuple[str, ...], after: tuple[str, ...] = (), codec: MCode = CODEC) -> Procedure[str]:
    reply = Reply()
    try:
        for text in texts:
            reply = yield codec.request("", text)
    except BaseException:
        for text in after:
            yield codec.request("", text)
        raise
    return reply.text


def request(text: str) -> Request:
    return CODEC.request("", text)


async def test_conversations_with_a_drive_take_turns_in_order():
    desk = Desk()
    runs = [desk.run("PR P", "PR V"), desk.run("PR A"), desk.run("PR D")]
    assert await asyncio.gather(*runs) == ["5", "5", "5"]
    assert desk.sent == ["PR P", "PR V", "PR A", "PR D"] and not desk.conversations.engaged(desk.state)


async def test_the_next_request_of_a_conversation_leaves_in_the_turn_that_read_the_reply():
    desk = Desk()
    running = desk.run("PR P", "PR V")
    await asyncio.sleep(0.005)
    desk.pipe.silent = True
    desk.pipe.received(b"\r\n5\r\n")
    assert desk.sent == ["PR P", "PR V"]
    running.cancel()


@pytest.mark.parametrize(("after", "sent"), [("MR 5", False), ("EM=1", True), ("PR EF", True)])
async def test_what_follows_a_stop_restores_and_asks_and_moves_nothing(after, sent):
    """A procedure that swallows a stop goes on with its line: the conversation holds that back."""
    desk = Desk()
    running = desk.run("PR P", after=(after,))
    await asyncio.sleep(0.005)
    desk.stop()
    with pytest.raises(Stopped):
        await running
    assert (after in desk.sent) is sent


async def test_each_stop_of_one_drive_ends_what_it_has_begun_or_waits_for_and_nothing_of_another_drive():
    desk, other = Desk(), DriveState(CODEC)
    for _ in range(2):
        desk.sent.clear()
        runs = [desk.run("PR P", "PR V"), desk.run("PR A")]
        beside = asyncio.ensure_future(desk.conversations.run(prints(("PR D", "PR I")), other))
        await asyncio.sleep(REPLY_AFTER / 2)
        desk.conversations.stop([desk.state])
        under_way, waiting = await asyncio.gather(*runs, return_exceptions=True)
        assert isinstance(under_way, Stopped) and "stopped; 'PR V' was not sent" in str(under_way)
        assert isinstance(waiting, Stopped) and "stopped before it was sent" in str(waiting)
        assert await beside == "5"
        assert desk.sent == ["PR P", "PR D", "PR I"]
    assert await desk.run("PR A") == "5"


async def test_thousands_of_conversations_that_wait_end_with_a_stop_and_none_is_sent():
    desk = Desk()
    runs = [desk.run("PR P") for _ in range(3000)]
    await asyncio.sleep(0.001)
    desk.conversations.stop(None)
    ends = await asyncio.gather(*runs, return_exceptions=True)
    assert ends[0] == "5" and all(isinstance(end, Stopped) for end in ends[1:]) and desk.sent == ["PR P"]


async def test_a_waiting_conversation_that_is_cancelled_gives_up_its_turn():
    desk = Desk()
    first, second, third = desk.run("PR P"), desk.run("PR A"), desk.run("PR D")
    await asyncio.sleep(0.001)
    second.cancel()
    assert await first == "5" and await third == "5" and second.cancelled()
    assert desk.sent == ["PR P", "PR D"]


@pytest.mark.parametrize(
    ("text", "silent", "said"),
    [
        ("R2=1", True, ["desk: 'R2=1' was interrupted; it is not known whether it was executed"]),
        ("PR P", True, []),
        ("R2=1", False, []),
    ],
)
async def test_a_command_whose_caller_goes_before_its_reply_is_not_lost_without_a_word(text, silent, said):
    desk = Desk()
    desk.pipe.silent = silent
    told = []
    desk.link.watch(lambda event: told.append(event.text) if isinstance(event, Notice) else None)
    running = desk.run(text)
    await asyncio.sleep(0.05)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    assert told == said and desk.sent == [text]


def notices(desk: Desk) -> list[str]:
    told: list[str] = []
    desk.link.watch(lambda event: told.append(event.text) if isinstance(event, Notice) else None)
    return told


INTERRUPTED = "desk: 'R2=1' was interrupted; it is not known whether it was executed"


@pytest.mark.parametrize("at", ["the question after it", "the clean-up after a stop", "its end"])
async def test_nor_one_whose_caller_goes_later(at):
    desk = Desk()
    desk.pipe.silent = True
    told = notices(desk)
    running = desk.run("R2=1", "PR EF", after=("PR EM",))
    await asyncio.sleep(0.05)
    conversation = desk.conversations.under_way[0]
    if at == "the question after it":
        while len(desk.sent) < 2:
            await asyncio.sleep(0.01)
        running.cancel()
    elif at == "its end":  # in the turn that settles the outcome
        conversation.over.add_done_callback(lambda _: running.cancel())
        desk.stop()
    else:
        desk.stop()
        await asyncio.sleep(0.3)
        running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    assert running.cancelled() and told == [INTERRUPTED]


async def test_of_a_command_that_a_stop_kept_from_the_port_nothing_is_said():
    desk = Desk()
    desk.pipe.write = lambda data: False
    told = notices(desk)
    running = desk.run("R2=1")
    await asyncio.sleep(0.01)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    assert told == []


async def test_a_command_to_all_drives_that_a_stop_cuts_off_may_be_executed():
    desk = Desk(codec=(party := MCode(em=1, party=True)))
    state = DriveState(party, "*")

    def broadcast() -> Procedure[None]:
        yield party.request("*", "MR 100")

    running = asyncio.ensure_future(desk.conversations.run(broadcast(), state))
    await asyncio.sleep(0.01)
    desk.stop()
    with pytest.raises(Stopped, match="'MR 100' was stopped; it is not known whether it was executed"):
        await running


async def test_a_cancelled_conversation_cleans_up_before_the_next_one_begins():
    desk = Desk()
    first, second = desk.run("PR P", "PR V", after=("PR EM", "PR ES")), desk.run("PR A")
    await asyncio.sleep(0.001)
    first.cancel()
    assert await second == "5" and first.cancelled()
    assert desk.sent == ["PR P", "PR EM", "PR ES", "PR A"] and desk.state.reply_pending


async def test_a_clean_up_is_not_cancelled():
    desk = Desk()
    first = desk.run("PR P", after=("PR EM", "PR ES"))
    await asyncio.sleep(0.001)
    first.cancel()
    await asyncio.sleep(0)
    for conversation in desk.conversations.under_way:
        conversation.interrupt()
    await asyncio.gather(*(each.over for each in desk.conversations.under_way))
    assert desk.sent == ["PR P", "PR EM", "PR ES"]


async def test_a_defect_reaches_the_caller_and_the_next_conversation_goes_on():
    def broken() -> Procedure[str]:
        yield request("PR P")
        raise ZeroDivisionError

    desk = Desk()
    first = asyncio.ensure_future(desk.conversations.run(broken(), desk.state))
    second = desk.run("PR A")
    with pytest.raises(ZeroDivisionError):
        await first
    assert await second == "5"


async def test_what_fails_in_who_waits_for_an_outcome_holds_up_nobody(caplog):
    def over(outcome) -> None:
        raise ZeroDivisionError

    desk = Desk()
    desk.conversations.start(prints(("PR P",)), desk.state, over)
    assert await desk.run("PR A") == "5"
    assert "a conversation on desk failed" in caplog.text


async def test_a_loss_ends_every_conversation_even_one_that_would_clean_up():
    desk = Desk()
    runs = [desk.run("PR P", after=("PR EM", "PR ES")), desk.run("PR A")]
    await asyncio.sleep(0.001)
    desk.pipe.lost(TransportLost("unplugged"))
    ends = await asyncio.gather(*runs, return_exceptions=True)
    assert [str(end) for end in ends] == ["unplugged", "unplugged"] and desk.sent == ["PR P"]
    assert desk.conversations.under_way == []


@pytest.mark.parametrize("how", ["lost", "stopped"])
@pytest.mark.parametrize(("late", "known"), [(False, "was executed before"), (True, "not known whether")])
async def test_what_ends_a_question_after_a_command_leaves_that_executed_or_after_a_doubtful_ack_not_known(
    how: str, late: bool, known: str
) -> None:
    desk = Desk(codec=MCode(em=1, checksum=1))
    desk.pipe.silent = True
    if late:
        await desk.run("PR A")  # it times out, and its ACK may come yet
        await asyncio.sleep(0.5)
    running = desk.run("MR 5", "PR P")
    await asyncio.sleep(0.01)
    desk.pipe.received(b"\x06")
    await asyncio.sleep(0.01)
    assert desk.sent[-2:] == ["MR 5", "PR P"]
    if how == "lost":
        desk.pipe.lost(TransportLost("unplugged"))
    else:
        desk.stop()
    with pytest.raises((TransportLost, Stopped), match="'MR 5' was ") as end:
        await running
    assert known in str(end.value)
    if isinstance(end.value, TransportLost):
        assert (end.value.unproven, end.value.executed) == (("MR 5", "") if late else ("", "MR 5"))


@pytest.mark.parametrize("acknowledged", [True, False])
async def test_a_loss_in_the_clean_up_after_a_stop_says_what_the_stop_left_open(acknowledged: bool) -> None:
    desk = Desk(codec=MCode(em=1, checksum=1))
    desk.pipe.silent = True
    running = desk.run("MR 5", "PR P", after=("EM=1", "PR EM"))
    await asyncio.sleep(0.01)
    if acknowledged:
        desk.pipe.received(b"\x06")
        await asyncio.sleep(0.01)
    desk.stop()
    await asyncio.sleep(0.2)
    assert desk.sent[-1] == "EM=1"
    desk.pipe.lost(TransportLost("unplugged"))
    with pytest.raises(TransportLost, match="^unplugged; .*'MR 5' was executed") as lost:
        await running
    assert (lost.value.unproven, lost.value.executed) == (("", "MR 5") if acknowledged else ("MR 5", ""))


class SlowKeeper(Keeper):
    """Takes its time to write."""

    kept = 0

    async def owes(self, state: DriveState) -> None:
        await asyncio.sleep(1.0)
        self.kept += 1


def owing(state: DriveState) -> Procedure[str]:
    state.owes(Owed(1, "", "LMDCM", "1", ""))
    return (yield from prints(("EM=0",)))


@pytest.mark.parametrize("how", ["cancel", "stop", "nothing"])
async def test_nothing_is_sent_before_what_is_owed_is_written_down(how: str) -> None:
    keeper = SlowKeeper()
    desk = Desk(keeper)
    running = asyncio.ensure_future(desk.conversations.run(owing(desk.state), desk.state))
    await asyncio.sleep(0.5)
    assert desk.sent == []
    if how == "cancel":
        running.cancel()
    elif how == "stop":
        desk.conversations.stop(None)
    await asyncio.wait([running])
    await asyncio.gather(*(each.over for each in desk.conversations.under_way))
    assert keeper.kept == 1 and desk.sent == (["EM=0"] if how == "nothing" else [])


async def test_an_operators_line_goes_before_the_next_poll_of_the_same_drive():
    desk = Desk()
    polls = 0

    def poll(outcome=None) -> None:
        nonlocal polls
        polls += 1
        if polls < 6:
            desk.conversations.start(polled(), desk.state, poll)

    def polled() -> Procedure[str]:
        return (yield Request("", "PR P", request("PR P").kind, CODEC, Priority.POLL, expect=r"\d"))

    poll()
    await asyncio.sleep(0.015)
    await desk.run("PR A")
    await asyncio.sleep(1.0)
    assert desk.sent == ["PR P", "PR P", "PR A", "PR P", "PR P", "PR P"]


@pytest.mark.parametrize(("priority", "first"), [(Priority.POLL, "Sent"), (Priority.OPERATOR, "Ended")])
async def test_the_next_poll_is_written_before_the_watchers_hear_of_the_reply_and_a_typed_line_after(priority, first):
    desk = Desk()
    told: list[tuple[str, int]] = []
    desk.link.watch(lambda event: told.append((type(event).__name__, len(desk.pipe.written))))

    def two() -> Procedure[str]:
        yield Request("", "PR P", request("PR P").kind, CODEC, priority, expect=r"\d")
        return (yield Request("", "PR V", request("PR V").kind, CODEC, priority, expect=r"\d")).text

    assert await desk.conversations.run(two(), desk.state) == "5"
    names = [name for name, _ in told]
    assert names == ["Sent", "Traffic", "Traffic", "Ended", "Sent", "Traffic", "Traffic", "Ended"]
    written = dict(told[3:4])["Ended"]
    assert written == (2 if first == "Sent" else 1)
