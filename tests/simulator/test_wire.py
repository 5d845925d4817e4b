"""One wire: pacing both ways, collisions, faults that repeat, wrong baud rates, the plug."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.simulator.cell.spec import Faults
from multidrop.simulator.wire import Transmission, Wire, resample

BYTE = 10 / 9600


class Parrot:
    """A port that says something when it hears its byte, and something by itself at given times."""

    def __init__(self, wants: bytes = b"\n", says: bytes = b"\r\n", later: dict[float, bytes] | None = None) -> None:
        self.wants, self.says = wants, says
        self.later = dict(later or {})
        self.heard: list[tuple[float, bytes]] = []
        self.out: list[tuple[float, bytes]] = []

    @property
    def deadline(self) -> float | None:
        return min(self.later, default=None)

    def receive(self, data: bytes, now: float) -> None:
        for byte in data:
            self.heard.append((now, bytes([byte])))
            if self.heard[-1][1] == self.wants:
                self.out.append((now, self.says))

    def quiet(self, now: float) -> bool:
        return not self.out and all(at > now for at in self.later)

    baud = 0

    def hears(self, byte: int) -> bool:
        return True

    def completes(self, data: bytes) -> bool:
        return self.wants in data

    def urgent(self, data: bytes) -> bool:
        return False

    def overhear(self, data: bytes, now: float) -> None:
        raise AssertionError("nobody tells anything")

    def sent(self, now: float) -> list[Transmission]:
        self.out += [(at, self.later.pop(at)) for at in sorted(self.later) if at <= now]
        out, self.out = self.out, []
        return [Transmission(at, data) for at, data in out]


def run(wire: Wire, until: float) -> list[tuple[float, bytes]]:
    """Step from deadline to deadline; what was heard, and when."""
    heard = []
    while (at := wire.deadline) is not None and at <= until:
        if data := wire.advance(at):
            heard.append((at, data))
    return heard


def said(heard: list[tuple[float, bytes]]) -> bytes:
    return b"".join(data for _, data in heard)


def test_bytes_take_their_time_both_ways() -> None:
    port = Parrot(b"\n", b"ok")
    wire = Wire([port], 9600)
    wire.receive(b"ab\n", 1.0)
    heard = run(wire, 2.0)
    assert [at for at, _ in port.heard] == pytest.approx([1.0 + BYTE * n for n in (1, 2, 3)])
    assert [at for at, _ in heard] == pytest.approx([1.0 + BYTE * n for n in (4, 5)])
    assert said(heard) == b"ok"


def test_a_second_write_queues_behind_the_first() -> None:
    port = Parrot()
    wire = Wire([port], 9600)
    wire.receive(b"abcd", 0.0)
    wire.advance(2 * BYTE)
    wire.receive(b"e", 2 * BYTE)
    run(wire, 1.0)
    assert [at for at, _ in port.heard] == pytest.approx([BYTE * n for n in range(1, 6)])


def test_an_unpaced_wire_answers_within_the_same_advance() -> None:
    wire = Wire([Parrot(b"\n", b"ok")])
    wire.receive(b"x\n", 5.0)
    assert wire.advance(5.0) == b"ok"
    assert wire.deadline is None


@pytest.mark.parametrize("baud", [0, 9600])
def test_a_late_caller_hears_the_same_as_a_prompt_one(baud: int) -> None:
    def make() -> Wire:
        wire = Wire([Parrot(b"\n", b"12345", {0.0042: b"by itself"}), Parrot(b"z", b"ABC")], baud)
        wire.receive(b"ab\nz", 0.001)
        return wire

    assert make().advance(1.0) == said(run(make(), 1.0))


@pytest.mark.parametrize("baud", [0, 9600])
def test_the_same_bytes_at_once_are_heard_once_and_others_as_their_and(baud: int) -> None:
    wire = Wire([Parrot(b"\x1b", b"\r\nA"), Parrot(b"\x1b", b"\r\nCx"), Parrot(b"?", b"!")], baud)
    wire.receive(b"\x1b", 0.0)
    assert wire.advance(1.0) == b"\r\n" + bytes([ord("A") & ord("C")]) + b"x"


def test_a_byte_begun_in_the_middle_of_another_is_swallowed() -> None:
    wire = Wire([Parrot(later={0.0: b"\xff\xf0"}), Parrot(later={BYTE / 2: b"\x0f"})], 9600)
    assert wire.advance(1.0) == b"\x0f\xf0"


def test_answers_to_different_bytes_do_not_collide_on_an_unpaced_wire() -> None:
    wire = Wire([Parrot(b"1", b"one"), Parrot(b"2", b"two")])
    wire.receive(b"12", 0.0)
    assert wire.advance(0.0) == b"onetwo"


def test_answers_that_overlap_in_time_garble_on_a_paced_wire() -> None:
    wire = Wire([Parrot(b"1", b"one"), Parrot(b"2", b"two")], 9600)
    wire.receive(b"12", 0.0)
    heard = wire.advance(1.0)
    assert heard == bytes([ord("o"), ord("n") & ord("t"), ord("e") & ord("w"), ord("o")])


def test_faults_repeat_with_the_same_seed_and_only_with_it() -> None:
    def heard(seed: int) -> bytes:
        port = Parrot(b"\n", b"0123456789" * 10)
        wire = Wire([port], 9600, Faults(flip=0.05, drop=0.05, delay=(0.001, 0.02)), Random(seed))
        wire.receive(b"\n" * 20, 0.0)
        return said(run(wire, 100.0)) + b"".join(data for _, data in port.heard)

    assert heard(1) == heard(1)
    assert heard(1) != heard(2)


def test_drops_and_flips_happen_in_both_directions() -> None:
    port = Parrot(b"x", b"y")
    wire = Wire([port], 0, Faults(drop=1.0))
    wire.receive(b"x", 0.0)
    assert wire.advance(0.0) == b"" and port.heard == []
    port = Parrot(later={1.0: b"\x00"})
    wire = Wire([port], 0, Faults(flip=1.0))
    wire.receive(b"\x00", 0.0)
    heard = wire.advance(1.0)
    assert heard[0].bit_count() == 1 and port.heard[0][1][0].bit_count() == 1


@pytest.mark.parametrize("baud", [0, 9600])
def test_a_reply_is_delayed_as_a_whole(baud: int) -> None:
    wire = Wire([Parrot(b"\n", b"abc")], baud, Faults(delay=(0.01, 0.02)))
    wire.receive(b"\n", 0.0)
    heard = run(wire, 1.0)
    byte = 10 / baud if baud else 0.0
    first, last = heard[0][0] - 2 * byte, heard[-1][0] - 4 * byte
    assert 0.01 <= first <= 0.02 and last == pytest.approx(first)
    assert said(heard) == b"abc"


def test_it_hangs_up_when_its_time_has_come_and_can_be_plugged_in_again() -> None:
    port = Parrot()
    wire = Wire([port], 0, Faults(hangup_after=30.0))
    assert wire.deadline == 30.0
    wire.receive(b"\n", 29.0)
    assert wire.advance(29.0) == b"\r\n"
    assert wire.advance(30.0) == b"" and wire.hung_up
    wire.receive(b"\n", 31.0)
    assert wire.advance(31.0) == b"" and len(port.heard) == 1
    wire.plug()
    wire.receive(b"\n", 32.0)
    assert wire.advance(32.0) == b"\r\n" and wire.deadline is None


def test_it_is_plugged_in_again_after_its_time_and_hangs_up_again() -> None:
    wire = Wire([Parrot()], 0, Faults(hangup_after=30.0, hangup_for=2.0))
    states = []
    for _ in range(4):
        now = wire.deadline
        wire.advance(now)
        states.append((now, wire.hung_up))
    assert states == [(30.0, True), (32.0, False), (62.0, True), (64.0, False)]


def test_bytes_are_doubled_and_inserted_in_both_directions() -> None:
    port = Parrot(b"\n", b"ab")
    wire = Wire([port], 0, Faults(double=1.0))
    wire.receive(b"x\n", 0.0)
    assert wire.advance(0.0) == b"aabbaabb"
    assert b"".join(data for _, data in port.heard) == b"xx\n\n"
    port = Parrot(later={1.0: b"ab"})
    wire = Wire([port], 0, Faults(insert=1.0))
    wire.receive(b"x", 0.0)
    heard = wire.advance(1.0)
    assert (len(heard), heard[1:2], heard[3:]) == (4, b"a", b"b") and port.heard[1][1] == b"x"


@pytest.mark.parametrize("baud", [0, 9600])
def test_a_late_byte_holds_up_those_behind_it_in_both_directions(baud: int) -> None:
    port = Parrot(b"\n", b"ab")
    wire = Wire([port], baud, Faults(late=1.0, late_by=(0.1, 0.1)))
    wire.receive(b"x\n", 0.0)
    heard = run(wire, 9.0)
    byte = 10 / baud if baud else 0.0
    assert [at for at, _ in port.heard] == pytest.approx([0.1 + byte, 0.2 + 2 * byte])
    assert heard == [(pytest.approx(0.3 + 3 * byte), b"a"), (pytest.approx(0.4 + 4 * byte), b"b")]


def test_what_has_not_gone_out_can_be_taken_back() -> None:
    port = Parrot()
    wire = Wire([port], 9600)
    wire.receive(b"MR 51200", 0.0, source=1)
    wire.receive(b"zz", 0.0, source=2)
    wire.advance(2.5 * BYTE)
    assert wire.retract(2.5 * BYTE, source=1) == 5
    run(wire, 1.0)
    assert b"".join(data for _, data in port.heard) == b"MR zz"


def test_a_wrong_baud_rate_is_garbage_for_every_drive_and_the_right_one_is_not() -> None:
    for baud, same in ((9600, True), (None, True), (19200, False), (4800, False), (115200, False)):
        port = Parrot()
        wire = Wire([port], 9600)
        wire.receive(b"aPR VR\n", 0.0, baud)
        run(wire, 1.0)
        assert (b"".join(data for _, data in port.heard) == b"aPR VR\n") is same
    port = Parrot()
    wire = Wire([port], 0)
    wire.receive(b"aPR VR\n", 0.0, 115200)
    wire.advance(0.0)
    assert len(port.heard) == 7


@given(st.binary(max_size=60), st.sampled_from([4800, 9600, 19200, 38400, 57600, 115200]))
def test_resampling_changes_nothing_at_the_same_rate_and_never_fails(data: bytes, baud: int) -> None:
    assert resample(data, baud, baud) == data
    assert len(resample(data, 9600, baud)) <= len(data) * 5
    assert resample(data, 9600 * 1.02, 9600) == data


def test_resampling_is_what_a_receiver_does() -> None:
    # Twice as fast a receiver sees each bit twice: 0xFF's start bit and one more low bit, then ones.
    assert resample(b"\xff", 9600, 19200) == b"\xfe"
    # A receiver of half the rate samples every other bit (2, 4, 6, the stop bit), and then the idle line.
    assert resample(b"\x04", 9600, 4800) == b"\xf9"


def test_what_a_byte_begins_without_a_word_is_heard_at_its_time() -> None:
    class Slow(Parrot):
        def receive(self, data: bytes, now: float) -> None:
            self.later[now + 1.0] = b"done"

    wire = Wire([Slow(), Parrot()], 9600)
    assert wire.advance(0.0) == b"" and wire.deadline is None
    wire.receive(b"\n", 0.0)
    assert said(run(wire, 0.9)) == b"\r\n", "of the other drive"
    assert wire.deadline == pytest.approx(1.0 + BYTE)
    assert said(run(wire, 2.0)) == b"done"


def test_a_drive_that_was_changed_by_another_way_is_asked_again() -> None:
    port = Parrot()
    wire = Wire([port])
    assert wire.advance(0.0) == b""
    port.out.append((1.0, b"by hand"))
    wire.look_again()
    assert wire.advance(1.0) == b"by hand"
