"""The floor's time beside the clock."""

from __future__ import annotations

import asyncio

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import LATEST, LONGEST_HELD, Listener, RunningFloor
from tests.support.virtual import hold_up, in_virtual_time

CELL = '[[bus]]\nname = "w"\nbaud = 1200\n[[bus.drive]]\npersonality = "LMDCM"\n'


class Heard(Listener):
    """A client that keeps what it hears."""

    def __init__(self) -> None:
        self.data = b""

    def receive(self, data: bytes) -> None:
        self.data += data


@in_virtual_time
async def test_a_process_that_stood_still_makes_up_for_a_tenth_of_a_second_and_serves_on() -> None:
    loop, floor, client = asyncio.get_running_loop(), RunningFloor(Floor(read(CELL, "cell"))), Heard()
    floor.attach("w", client)
    await asyncio.sleep(10.0)
    assert floor.now() == pytest.approx(loop.time())
    floor.write("w", b"PR 5\r")
    begun = floor.now()
    hold_up(60.0)
    stood = floor.now()
    assert begun < stood <= begun + LATEST + 0.1
    await asyncio.sleep(1.0)
    assert b"5" in client.data
    assert floor.now() == pytest.approx(stood + 1.0)
    floor.close()


class Pieces(Listener):
    """An endpoint that keeps each piece and its time."""

    def __init__(self, floor: RunningFloor, gathers: bool) -> None:
        self.gathers, self._floor = gathers, floor
        self.pieces: list[tuple[float, bytes]] = []
        floor.attach("w", self)

    def receive(self, data: bytes) -> None:
        self.pieces.append((self._floor.now(), data))


SERIAL = '[[bus]]\nname = "w"\nbaud = 9600\n{}\n[[bus.drive]]\npersonality = "LMDCM"\nset = {{ EM = 1 }}\n'
LONG = b'PR "' + b"0123456789" * 5 + b'"\r'


async def pieces(gather: str, sent: bytes) -> tuple[list[tuple[float, bytes]], list[tuple[float, bytes]]]:
    """What a gathering endpoint and another one receive."""
    floor = RunningFloor(Floor(read(SERIAL.format(gather), "cell")))
    gathered, plain = Pieces(floor, True), Pieces(floor, False)
    floor.write("w", sent)
    await asyncio.sleep(1.0)
    floor.close()
    return gathered.pieces, plain.pieces


@pytest.mark.parametrize("gather", ["", "gather = 0.016", "gather = 0.0021"])
@in_virtual_time
async def test_a_short_reply_is_one_piece_at_the_time_of_its_last_byte(gather: str) -> None:
    gathered, plain = await pieces(gather, b"PR 12345\r")
    assert [data for _, data in gathered] == [b"\r\n12345\r\n"]
    assert [data for _, data in plain] == [bytes([each]) for each in b"\r\n12345\r\n"]
    assert gathered[-1][0] == plain[-1][0]


@in_virtual_time
async def test_a_long_reply_is_held_for_a_fiftieth_of_a_second_at_most() -> None:
    gathered, plain = await pieces("", LONG)
    times = {n: at for n, (at, _) in enumerate(plain)}
    assert (
        b"".join(data for _, data in gathered) == b"".join(data for _, data in plain) == b"\r\n" + LONG[4:-2] + b"\r\n"
    )
    assert gathered[-1][0] == plain[-1][0] and len(gathered) == 3
    first = 0
    for at, data in gathered:
        assert at - times[first] <= LONGEST_HELD
        first += len(data)


@pytest.mark.parametrize("gather", ["gather = 0", "gather = 0.001"])
@in_virtual_time
async def test_a_gather_below_a_character_time_delivers_each_byte_by_itself(gather: str) -> None:
    gathered, plain = await pieces(gather, b"PR 12345\r")
    assert gathered == plain


def test_gather_is_for_serial_drives_and_ends_at_20_ms() -> None:
    for gather, told in (("gather = 0.021", "gather must be from"), ("gather = -1", "gather must be from")):
        with pytest.raises(Diagnostic, match=told):
            read(SERIAL.format(gather), "cell")
    with pytest.raises(Diagnostic, match="gather is for serial drives"):
        read(SERIAL.format("gather = 0.01").replace("LMDCM", "LMDCE"), "cell")
