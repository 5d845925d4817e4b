"""Controllers on a line: the stop's pieces and their gaps, late answers of another one, all of them told in turn."""

import asyncio
from random import Random

import pytest

from multidrop.base.errors import NoAnswer, Refused, Stopped
from multidrop.dialects import End, Hints, Priority, StopPiece
from multidrop.drives.bus import Bus
from multidrop.drives.events import Unsolicited
from multidrop.drives.line import RECOVERY_QUIET, Finished, Line, Write
from multidrop.drives.stop_forms import stop_forms
from multidrop.drives.stopping import Fate
from multidrop.families.pmx.host.codec import STOP_PIECE_QUIET, Pmx
from multidrop.transports import Transport
from tests.support.virtual import in_virtual_time

pytestmark = pytest.mark.virtual

BYTE = 10 / 9600


class Wire(Transport):
    """A transport to controllers that answer after a while, as text by command; it notices what talks at once."""

    def __init__(self, loop, *numbers, latency=0.006, **answers):
        self.name, self._loop, self.numbers, self.latency = "wire", loop, numbers, latency
        self.answers = {"ID": "Performax-2ED-SA", "VER": "V128BL", "DN": "2ED00"} | answers
        self.written, self.collisions = [], []
        self._talking_until = self._ours_until = 0.0

    def start(self, received, lost):
        self._received = received

    def write(self, data):
        now = self._loop.time()
        self.written.append((now, data))
        if now < self._talking_until - BYTE / 2:
            self.collisions.append(data)
        self._ours_until = max(now, self._ours_until)
        for piece in data.split(b"\r")[:-1]:
            self._ours_until += (len(piece) + 1) * BYTE
            self._hear(piece.decode())
        return True

    def _hear(self, line):
        number, text = line[1:3], line[3:]
        if line[:1] != "@" or number not in self.numbers:
            return
        other = "OK" if text.startswith(("ABORT", "SR")) else f"?{text}" if text.startswith("Q") else "0"
        answer = self.answers.get(text, other)
        if answer is None:
            return
        begin = self._ours_until + self.latency
        self._talking_until = begin + (len(answer) + 1) * BYTE
        self._loop.call_at(self._talking_until, self._received, answer.encode() + b"\r")

    def discard(self, whole=False):
        return 0

    async def close(self):
        pass


class Overtaken(Wire):
    """A wire on which another thread writes a stop; what the loop writes is dropped until it has taken that over."""

    held = False

    def preempt(self, whole, make):
        self.held = super().write(make(self.discard(whole)))
        return True

    def yielded(self, note=lambda last: None):
        self.held = False
        note(True)
        return True

    def write(self, data):
        return not self.held and super().write(data)


async def opened(*numbers, kind=Wire, **answers):
    wire = kind(asyncio.get_running_loop(), *numbers, **answers)
    bus = Bus("cell", wire, baud=9600, family="pmx")
    bus.start()
    await bus.identify(Hints(drives=numbers))
    return bus, wire


@pytest.mark.parametrize(("left", "said"), [(True, "it is not known"), (False, "was not sent")])
async def test_the_reply_to_a_stop_that_the_loop_has_not_taken_over_is_none_to_a_command(left, said):
    bus, _ = await opened("00", kind=Overtaken, **{"V1=5": None})
    send = bus.drives["00"].send
    sent = asyncio.ensure_future(send("V1=5"))
    if left:
        await asyncio.sleep(0.01)
    bus.stop_ahead()
    await asyncio.sleep(0.1)
    assert not sent.done()
    bus.stop()
    with pytest.raises(Stopped, match=said):
        await sent


async def test_a_stop_reaches_every_known_number_and_no_answers_run_into_it():
    bus, wire = await opened("00", "01", "02")
    told = []
    bus.watch(lambda event: told.append(getattr(event, "text", "")))
    wire.written.clear()
    begin = bus.now()
    bus.stop()
    assert wire.written == [(begin, b"@00ABORT\r")]
    await bus.stopped()
    commands = [data for _, data in wire.written]
    assert commands[:4] == [b"@00ABORT\r", b"@01ABORT\r", b"@02ABORT\r", b"@00ABORT\r"]
    for number in (b"00", b"01", b"02"):
        own = [data[3:] for data in commands if data[1:3] == number and data[3:5] in (b"AB", b"SR")]
        assert own[-3:] == [b"SR0=0\r", b"SR1=0\r", b"ABORT\r"]
    assert wire.collisions == []
    first = [at - begin for at, data in wire.written if data == b"@02ABORT\r"][0]
    assert first < 0.15
    assert [text for text in told if "stopped, velocity 0 at 0, 0" in text] and "OK" not in told
    await bus.close()


@pytest.mark.parametrize("program", ["SASTAT0", "SASTAT1"])
@pytest.mark.parametrize(
    ("answer", "fate", "said", "aborts"),
    [
        ("1", Fate.RUNNING, "STILL RUNNING after 3 stops: 00; cut the power", 9),
        (None, Fate.NOT_KNOWN, "00: stop sent, but velocity 0 was read, and whether a program runs was not: ", 3),
        ("2", Fate.STANDING, "00: stopped, velocity 0 at 0, 0", 3),
    ],
)
async def test_a_stop_is_confirmed_by_both_programs_too(program, answer, fate, said, aborts):
    bus, wire = await opened("00", **{program: answer})
    wire.written.clear()
    told = []
    bus.watch(lambda event: told.append(getattr(event, "text", "")))
    halt = bus.stop()
    await bus.stopped()
    assert halt.fate(bus.drives["00"]) is fate and any(text.startswith(said) for text in told)
    assert [data for _, data in wire.written].count(b"@00ABORT\r") == aborts
    await bus.close()


async def test_one_that_was_only_spoken_to_is_stopped_too_and_alone_at_first():
    bus, wire = await opened("00")
    wire.numbers = ("00", "05")
    spoken = asyncio.create_task(bus.at("05").send("PX"))
    await asyncio.sleep(0.001)
    forms = stop_forms(bus.roster)
    assert forms.immediate in (b"@00ABORT\r", b"@05ABORT\r")
    assert {b"@00ABORT\r", b"@05ABORT\r", b"@05SR0=0\r"} <= {forms.immediate, *(piece.data for piece in forms.repeats)}
    assert await spoken == ("0",)
    await bus.close()


class Delayed(Wire):
    """Every reply is late, in the order of the lines."""

    def _hear(self, line):
        answer = "OK" if line[3:].startswith(("ABORT", "SR")) else self.answers.get(line[3:], f"?{line[3:]}")
        if answer is not None:
            self._loop.call_later(self.latency, self._received, answer.encode() + b"\r")


@pytest.mark.parametrize("only", [None, "00", "01"])
async def test_a_late_reply_to_a_stop_is_none_to_a_command_that_is_lost(only):
    bus, wire = await opened("00", "01", kind=Delayed, **{"V1=5": None})
    wire.latency = 0.25
    bus.stop(None if only is None else [bus.drives[only]])
    with pytest.raises(NoAnswer, match="it is not known whether 'V1=5' was executed"):
        await bus.drives["00"].send("V1=5")
    written = [data[3:-1] for _, data in wire.written if data[1:3] == b"00"]
    assert written[written.index(b"V1=5") - 1].startswith(b"Q00"), "a mark is before it"
    await bus.close()


async def test_a_command_that_waits_as_another_controller_is_stopped_is_not_sent():
    """A late reply to that stop would pass for its own: it has its mark behind it."""
    bus, wire = await opened("00", "01", PX=None)
    asked = asyncio.ensure_future(bus.drives["01"].send("PX"))
    await asyncio.sleep(0.02)
    waits = asyncio.ensure_future(bus.drives["00"].send("V1=5"))
    await asyncio.sleep(0.02)
    bus.stop([bus.drives["01"]])
    with pytest.raises(Stopped, match="00: stopped; 'V1=5' was not sent"):
        await waits
    await asyncio.gather(asked, return_exceptions=True)
    assert not any(b"V1=5" in data for _, data in wire.written)
    await bus.close()


@pytest.mark.parametrize(
    ("text", "said"),
    [("V1=5", "stopped; 'V1=5' was not sent"), ("V1", "stopped; 'V1' was not sent")],
)
async def test_a_line_whose_mark_a_stop_cuts_off_is_not_sent(text, said):
    bus, wire = await opened("00", kind=Delayed)
    wire.latency = 0.25
    bus.drives["00"].state.reply_outstanding()
    sent = asyncio.ensure_future(bus.drives["00"].send(text))
    while not any(data.startswith(b"@00Q") for _, data in wire.written):
        await asyncio.sleep(0.01)
    bus.stop()
    with pytest.raises(Stopped, match=said):
        await sent
    assert not any(text.encode() in data for _, data in wire.written)
    await bus.close()


async def test_a_question_that_a_stop_cuts_off_has_no_reply():
    bus, _ = await opened("00", PX=None)
    sent = asyncio.ensure_future(bus.drives["00"].send("PX"))
    await asyncio.sleep(0.05)
    bus.stop()
    with pytest.raises(Stopped, match="'PX' was stopped before its reply came"):
        await sent
    await bus.close()


async def test_a_late_answer_of_one_is_not_taken_for_anothers():
    bus, wire = await opened("00", "01", PX="5")
    wire.answers["PX"] = None
    with pytest.raises(NoAnswer):
        await bus.at("00").send("PX")
    wire.answers["PX"] = "7"
    assert await bus.at("01").send("PX") == ("7",)
    assert [data for _, data in wire.written][-2:] == [b"@01PX\r", b"@01Q01001\r"]
    await bus.close()


async def test_to_all_is_told_to_each_in_turn_and_one_failure_keeps_it_from_none():
    bus, wire = await opened("00", "01", PX="5")
    wire.written.clear()
    assert await bus.at("*").send("PX") == ("5", "5")
    assert [data for _, data in wire.written] == [b"@00PX\r", b"@01PX\r"]
    wire.answers["X5"] = "?Moving"
    with pytest.raises(Refused, match="00 refused 'X5'"):
        await bus.at("*").send("X5")
    assert [data for _, data in wire.written if data[3:4] == b"X"] == [b"@00X5\r", b"@01X5\r"]
    await bus.close()


def test_the_gap_is_only_between_pieces_of_a_stop():
    line = Line(Pmx(), timeout=1.0)
    line.stop(0.0, StopPiece(b"one\r", 0.03), StopPiece(b"two\r", 0.03))
    line.ask(Pmx().request("00", "PX"))
    seen = []
    now = 0.0
    while len(seen) < 3:
        now = line.deadline
        seen += [(round(now, 3), event.data) for event in line.events(now) if isinstance(event, Write)]
    assert seen == [
        (STOP_PIECE_QUIET, b"one\r"),
        (2 * STOP_PIECE_QUIET, b"two\r"),
        (round(2 * STOP_PIECE_QUIET + RECOVERY_QUIET, 3), b"@00PX\r"),
    ]


def test_what_nobody_asked_for_is_shown_but_not_the_answers_to_a_stop():
    line = Line(Pmx())
    line.receive(b"OK\r\n123\r", 0.0)
    assert line.events(0.0) == [Unsolicited(0.0, ("123",))]
    line.ask(Pmx().request("00", "PX"))
    line.events(1.0)
    line.receive(b"?PX\r", 1.1)
    (ended,) = [event for event in line.events(1.1) if isinstance(event, Finished)]
    assert ended.reply.end is End.REFUSED and ended.request.priority is Priority.OPERATOR


class Slow(Wire):
    """Each answer takes as long as chance has it; in their order for each controller."""

    def __init__(self, loop, random, loss, *numbers):
        super().__init__(loop, *numbers)
        self.random, self.loss, self.after = random, loss, dict.fromkeys(numbers, 0.0)

    def _hear(self, line):
        number, text = line[1:3], line[3:]
        if number not in self.numbers or self.random.random() < self.loss:
            return
        answer = number + text[1:] if text.startswith("V") and text != "VER" else f"?{text}"
        delay = self.random.choice((0.0, 0.0, 0.0, 0.2, 0.35, 0.6, 1.1))
        self.after[number] = max(self.after[number] + 0.001, self._loop.time() + delay)
        self._loop.call_at(self.after[number], self._received, answer.encode() + b"\r")


@pytest.mark.parametrize(("loss", "numbers"), [(0.0, ("00", "01")), (0.1, ("00",))])
def test_no_late_answer_is_ever_taken_for_another_one(loss, numbers, nightly):
    @in_virtual_time
    async def ask(seed):
        chance = Random(seed)
        wire = Slow(asyncio.get_running_loop(), chance, loss, *numbers)
        bus = Bus("cell", wire, baud=9600, timeout=0.3, family="pmx")
        bus.start()
        drives = [bus.at(number) for number in numbers]
        for drive in drives:
            drive.state.settings_unknown = False
            bus.drives[drive.address] = drive
        right = 0
        for n in range(60):
            drive = chance.choice(drives)
            try:
                printed = await drive.send(f"V{n}")
            except NoAnswer:
                continue
            assert printed == (f"{drive.address}{n}",), (n, printed)
            right += 1
        assert right > 5
        await bus.close()

    for seed in range(30 if nightly else 12):
        ask(seed)
