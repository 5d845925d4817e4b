"""A link: what it writes and publishes in which order, bytes without a question, its loss and its end."""

import asyncio
from typing import Any

import pytest

from multidrop.base.errors import TransportLost
from multidrop.dialects import End, Kind, Priority, Reply, Request, StopPiece
from multidrop.drives.events import Changed, Ended, Lost, Notice, Sent, Traffic, Transaction, Unsolicited
from multidrop.drives.inbox import LATE_WITHIN
from multidrop.drives.line import Line
from multidrop.drives.link import AS_GREETING, ECHO, GREETING, UNASKED, UNLIKE_A_DRIVE, Link, LostInFlight, Reserved
from multidrop.drives.port_journal import Keeper
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.transports import Transport

pytestmark = pytest.mark.virtual
CODEC = MCode(em=1)


class Picky(MCode):
    """A language in which a line with `foreign` is none of a drive, one with `bad` is damaged, and `=` replies late."""

    def printed(self, line: str) -> bool:
        return "foreign" not in line

    def damaged(self, line: str) -> bool:
        return "bad" in line

    def answers_host(self, line: str) -> bool:
        return line.startswith("=")


class Replies(MCode):
    stop_replies = True


class Pipe(Transport):
    name = "pipe"
    takes, closed = True, 0

    def __init__(self, network: bool = False) -> None:
        self.network = network
        self.written: list[tuple[float, bytes]] = []

    def start(self, received: Any, lost: Any) -> None:
        self.received, self.lost = received, lost

    def write(self, data: bytes) -> bool:
        if self.takes:
            self.written.append((asyncio.get_running_loop().time(), data))
        return self.takes

    def discard(self, whole: bool = False) -> int:
        return 0

    async def close(self) -> None:
        self.closed += 1


class Record(Keeper):
    def __init__(self) -> None:
        self.notes: list[str] = []

    def begun(self, line: str) -> None:
        self.notes.append(f"begun {line}")

    def ended(self) -> None:
        self.notes.append("ended")

    def close(self) -> None:
        self.notes.append("closed")


class Desk:
    def __init__(self, codec: MCode = CODEC, network: bool = False, baud: int = 0) -> None:
        self.codec, self.pipe, self.keeper = codec, Pipe(network), Record()
        self.link = Link("desk", self.pipe, Line(codec, baud=baud), self.keeper)
        self.events: list[Any] = []
        self.answers: list[Any] = []
        self.link.watch(self.events.append)
        self.link.start()

    def ask(self, text: str = "PR P", kind: Kind | None = None, **more: Any) -> int:
        request = self.codec.request("a", text) if kind is None else Request("a", text, kind, self.codec, **more)
        ticket = self.link.submit(request, self.answers.append)
        self.link.advance()
        return ticket

    async def hear(self, data: bytes, then: float = 0.1) -> None:
        self.pipe.received(data)
        await asyncio.sleep(then)

    @property
    def told(self) -> list[str]:
        return [each.text for each in self.events if isinstance(each, Notice)]

    @property
    def prints(self) -> list[tuple[tuple[str, ...], bool]]:
        return [(each.lines, each.greeting) for each in self.events if isinstance(each, Unsolicited)]

    @property
    def kinds(self) -> list[str]:
        return [type(each).__name__ for each in self.events]


def heard(desk: Desk) -> Desk:
    desk.link.heard.replied("a")
    return desk


async def test_a_request_is_written_published_and_answered_in_this_order():
    desk = Desk()
    ticket = desk.ask()
    written = desk.pipe.written[0][1]
    assert desk.kinds == ["Sent", "Traffic"] and desk.events[1] == Traffic(0.0 + desk.events[0].at, True, written)
    await desk.hear(b"\r\n5\r\n")
    assert desk.kinds == ["Sent", "Traffic", "Traffic", "Ended"]
    assert desk.events[2][1:] == (False, b"\r\n5\r\n", False)
    ended = desk.events[3]
    assert isinstance(ended, Ended) and ended.at == ended.transaction.ended_at and desk.answers == [ended.transaction]
    assert not desk.link.withdraw(ticket) and not desk.link.unheard


async def test_a_command_is_on_record_until_it_is_answered_and_a_question_is_not():
    desk = Desk()
    desk.ask("MR 1")
    assert desk.keeper.notes == ["begun aMR 1"] and desk.link.cut == "aMR 1"
    await desk.hear(b"\x06")
    await asyncio.sleep(2)
    assert desk.keeper.notes == ["begun aMR 1", "ended"] and desk.link.cut == ""
    desk.ask("PR P")
    assert desk.keeper.notes[2:] == []


async def test_a_command_that_a_stop_cut_off_stays_on_record():
    desk = Desk()
    desk.ask("MR 1")
    desk.link.line.stop(desk.link.now())
    desk.link.advance()
    assert desk.link.cut == "aMR 1" and [each.reply.end for each in desk.answers] == [End.STOPPED]


async def test_a_request_that_is_withdrawn_is_not_written_and_calls_nobody():
    desk = Desk()
    desk.ask("PR P")
    second = desk.ask("PR V")
    assert desk.link.withdraw(second)
    assert not desk.link.withdraw(second)
    await asyncio.sleep(5)
    assert len(desk.pipe.written) == 1 and len(desk.answers) == 1


async def test_what_the_transport_does_not_take_is_not_published_as_sent():
    desk = Desk()
    desk.pipe.takes = False
    desk.ask("MR 1")
    assert desk.events == [] and desk.keeper.notes == []
    await asyncio.sleep(2)
    assert [(each.sent, each.reply.end) for each in desk.answers] == [(False, End.TIMEOUT)]


async def test_a_piece_of_a_stop_is_published_as_one():
    desk = Desk()
    desk.link.line.stop(desk.link.now(), StopPiece(b"\x1b", 0.1))
    desk.link.advance()
    await asyncio.sleep(0.2)
    [traffic] = desk.events
    assert traffic[1:] == (True, b"\x1b", True)
    assert desk.link.debris.may_come(desk.link.now()) and desk.link.line.owed_pieces() == []


async def test_the_time_of_each_stop_and_start_is_later_than_the_one_before():
    desk = Desk()
    first, second = desk.link.stamp(), desk.link.stamp()
    assert first == desk.link.now() < second
    await asyncio.sleep(1)
    assert desk.link.stamp() == desk.link.now()


# What nobody asked for


async def test_a_print_is_published_and_a_damaged_one_is_said():
    desk = heard(Desk(Picky(em=1)))
    await desk.hear(b"one\r\nbad two\r\nthree\r\n")
    assert desk.prints == [(("one", "three"), False)]
    assert desk.told == ["a printed line was damaged on the line (received 'bad two')"]
    assert [each.warning for each in desk.events if isinstance(each, Notice)] == [True]


async def test_what_no_drive_sends_is_said_now_and_then_with_the_number_in_all():
    desk = heard(Desk(Picky(em=1)))
    await desk.hear(b"foreign 1\r\none\r\n")
    await desk.hear(b"foreign 2\r\n", UNASKED)
    await desk.hear(b"foreign 3\r\n")
    assert desk.prints == [(("one",), False)]
    assert desk.told == [
        f"received without a question: 'foreign 1'; {UNLIKE_A_DRIVE}",
        f"received without a question (3 in all): 'foreign 3'; {UNLIKE_A_DRIVE}",
    ]


async def test_a_long_line_is_shown_from_its_beginning():
    desk = heard(Desk(Picky(em=1)))
    for text in ("foreign" + "x" * 53, "foreign" + "x" * 54):
        await desk.hear(text.encode() + b"\r\n", UNASKED + 1)
    assert [each.split("'")[1] for each in desk.told] == ["foreign" + "x" * 53, "foreign" + "x" * 53 + "..."]


async def test_what_a_session_before_has_left_is_said_and_is_no_print():
    desk = heard(Desk(Picky(em=1)))
    await desk.hear(b"=5\r\none\r\n", LATE_WITHIN + 0.1)
    await desk.hear(b"=6\r\n")
    assert desk.prints == [(("one",), False), (("=6",), False)]
    assert desk.told == ["left by a session before, not printed by a program: '=5'"]


@pytest.mark.parametrize(
    ("network", "replied", "after", "greeting"),
    [
        (True, False, 0.0, True),
        (True, False, GREETING, False),
        (True, True, 0.0, False),
        (False, False, 0.0, False),
    ],
)
async def test_what_comes_at_first_on_a_network_may_be_a_greeting(network, replied, after, greeting):
    desk = Desk(network=network)
    if replied:
        desk.link.heard.replied("a")
    await asyncio.sleep(after)
    await desk.hear(b"hello\r\n")
    assert desk.prints == [(("hello",), greeting)]
    assert desk.told == ([f"received before a drive replied: 'hello'; {AS_GREETING}"] if greeting else [])


async def test_bytes_without_a_question_are_told_to_the_owner_unless_they_are_debris_of_a_stop():
    desk, asked = heard(Desk()), []
    desk.link.on_unasked = lambda: asked.append(desk.link.now())
    await desk.hear(b"one\r\n")
    desk.link.debris.stop_written(b"\x1b", desk.link.now())
    await desk.hear(b"two\r\n")
    assert len(asked) == 1


async def test_lines_reach_the_owner_before_anything_is_taken_from_them():
    desk, lines = heard(Desk(Picky(em=1))), list[Any]()
    desk.link.on_unsolicited = lines.append
    await desk.hear(b"one\r\nforeign\r\nbad\r\n")
    assert lines == [("one", "foreign", "bad")]


async def test_a_print_that_was_destroyed_beside_a_request_is_said_with_its_drive():
    desk = heard(Desk())
    ticket = desk.ask()
    found = Reply(("5",), collided=("x", "y"))

    def finish(request: Request) -> None:
        from multidrop.drives.line import Finished

        done = Transaction(request, found, 0.0, 1.0, 0.5)
        desk.link._finished(Finished(ticket, done))

    finish(CODEC.request("a", "PR P"))
    finish(Request("", "PR P", Kind.PRINT, CODEC, Priority.POLL))
    assert desk.told == [
        "beside 'PR P' of a something was damaged on the line: printed lines may be lost (received 'x y')",
        "beside a poll something was damaged on the line: printed lines may be lost (received 'x y')",
    ]
    assert [each.address for each in desk.events if isinstance(each, Notice)] == ["a", ""]


async def test_what_is_received_meanwhile_can_be_gathered():
    desk = heard(Desk())
    await desk.hear(b"before\r\n")
    with desk.link.received() as got:
        desk.ask()
        await desk.hear(b"\r\n5\r\n")
    await desk.hear(b"after\r\n")
    assert got == b"\r\n5\r\n"


async def test_an_adapter_that_repeats_is_said():
    desk = Desk()
    desk.link.on_echo()
    assert desk.told == [ECHO]


# A person's own bytes


async def test_a_persons_bytes_are_on_record_until_the_end_of_their_line_has_left():
    desk = Desk(baud=1000)
    assert desk.link.write_raw(b"MR 1\r")
    assert desk.keeper.notes == ["begun MR 1\r"] and desk.events[0][1:] == (True, b"MR 1\r", False)
    await asyncio.sleep(0.04)
    assert desk.link.cut == "MR 1\r"
    await asyncio.sleep(0.02)
    assert desk.link.cut == "" and desk.keeper.notes[1:] == ["ended"]
    assert desk.link.write_raw(b"MR")
    await asyncio.sleep(5)
    assert desk.link.cut == "MR" and not desk.link.line.last_write_was_stop


async def test_a_persons_bytes_that_a_stop_kept_back_are_on_no_record():
    desk = Desk()
    desk.pipe.takes = False
    assert not desk.link.write_raw(b"MR 1\r")
    assert desk.keeper.notes == [] and desk.events == []


async def test_on_a_lost_line_a_persons_bytes_are_refused():
    desk = Desk()
    desk.pipe.lost(TransportLost("gone"))
    with pytest.raises(TransportLost, match="gone"):
        desk.link.write_raw(b"MR 1\r")
    assert desk.pipe.written == []


# The loss


async def test_a_loss_fails_what_is_in_flight_and_what_waits_and_is_published_once():
    desk = Desk()
    desk.ask("PR P")
    desk.ask("PR V")
    desk.events.clear()
    loss = TransportLost("gone")
    desk.pipe.lost(loss)
    desk.pipe.lost(TransportLost("again"))
    assert [type(each) for each in desk.answers] == [LostInFlight, TransportLost]
    assert [str(each) for each in desk.answers] == ["gone", "gone"]
    now = desk.link.now()
    assert desk.events == [Lost(now, loss), Changed(now)]
    assert desk.link.lost is desk.link.loss is desk.link.away is loss
    with pytest.raises(TransportLost):
        desk.ask()


async def test_after_a_loss_only_the_search_passes_until_the_drives_are_found():
    desk, pipe = Desk(), Pipe()
    desk.pipe.lost(TransportLost("gone"))
    with pytest.raises(TransportLost, match="gone"):
        desk.link.resumed()
    desk.link.line.overtaken = True
    desk.link.resume(pipe)
    assert desk.link.lost is None and desk.link.loss is not None and not desk.link.line.overtaken
    request = CODEC.request("a", "PR P")
    with pytest.raises(TransportLost):
        desk.link.submit(request, desk.answers.append)
    desk.link.submit(request, desk.answers.append, searching=True)
    desk.link.advance()
    await asyncio.sleep(1)
    assert len(pipe.written) == 1
    desk.link.resumed()
    assert desk.link.away is None
    desk.ask()


async def test_a_line_that_is_closed_for_a_while_loses_without_a_word():
    desk = Desk()
    desk.ask()
    desk.events.clear()
    await desk.link.detach(TransportLost("lent"))
    assert [str(each) for each in desk.answers] == ["lent"] and desk.pipe.closed == 1
    assert desk.kinds == ["Changed"] and str(desk.link.loss) == "lent"
    desk.pipe.lost(TransportLost("gone"))
    assert desk.kinds == ["Changed"]


async def test_a_line_that_a_person_has_is_away_and_not_lost():
    desk = Desk()
    desk.link.reserved = Reserved("raw")
    assert desk.link.away is desk.link.reserved and desk.link.loss is None
    with pytest.raises(Reserved):
        desk.ask()


# The end


async def test_the_end_writes_what_is_left_of_a_stop_at_once_and_fails_what_waits():
    desk = Desk()
    desk.ask("MR 1")
    desk.link.line.stop(desk.link.now(), StopPiece(b"\x1b", 0.1), StopPiece(b"\x05", 0.1))
    desk.ask("PR V")
    desk.link.shut()
    assert [data for _, data in desk.pipe.written[1:]] == [b"\x1b\x05"]
    assert str(desk.answers[-1]) == "pipe is closed" and str(desk.link.lost) == "pipe is closed"
    await desk.link.close()
    assert desk.pipe.closed == 1 and desk.keeper.notes == ["begun aMR 1", "ended", "closed"]


async def test_the_end_of_a_lost_line_writes_nothing_and_leaves_the_record():
    desk = Desk()
    desk.ask("MR 1")
    desk.pipe.lost(TransportLost("gone"))
    desk.link.shut()
    await desk.link.close()
    assert len(desk.pipe.written) == 1 and str(desk.link.lost) == "gone"
    assert desk.keeper.notes == ["begun aMR 1", "closed"] and desk.pipe.closed == 1


async def test_where_drives_reply_to_a_stop_its_rest_is_written_piece_by_piece_before_the_pause():
    desk = Desk(Replies(em=1), baud=1000)
    pieces = StopPiece(b"A" * 5, 0.1), StopPiece(b"B" * 5, 0.2), StopPiece(b"C", 0.6)
    desk.link.line.stop(desk.link.now(), *pieces)
    desk.link.line.transmitted_at = begun = desk.link.now()
    desk.link.shut()
    assert desk.pipe.written == []
    await desk.link.close()
    times = [(round(at - begun, 3), data[:1]) for at, data in desk.pipe.written]
    assert times == [(0.15, b"A"), (0.45, b"B")] and desk.pipe.closed == 1


async def test_each_request_is_published_as_sent():
    desk = Desk()
    desk.ask("PR P")
    [sent] = [each for each in desk.events if isinstance(each, Sent)]
    assert (sent.at, sent.request.text) == (desk.link.now(), "PR P")
