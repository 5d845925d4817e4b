"""Another program on the line causes errors: a line that was executed is never called refused."""

import asyncio

import pytest

from multidrop.base.errors import DriveError, NoAnswer, Refused
from multidrop.dialects import Hints
from tests.support.cases import for_each
from tests.support.cell_session import ETHERNET, drive, party, pmx
from tests.support.simulated_bus import SimulatedBus

pytestmark = pytest.mark.virtual
ALONE = 'personality = "LMDCM"\nset = {{ EM = {}, CK = {} }}'
FOREIGN = ("AT\r", "VM=99999999999\r", "MS=7\r", "EX ZZ\r", "BR 9\r", "D9=1\r")
"""Lines of others, each an error: 20, 21 and others."""


async def outcome(line: SimulatedBus, address: str, text: str) -> str:
    """Send a line; how it ended."""
    try:
        await line.send(address, text)
    except Refused:
        return "refused"
    except NoAnswer as error:
        assert "not known whether" in str(error) or "was not sent" in str(error)
        return "not known"
    return "done"


def other(line: SimulatedBus, data: bytes) -> None:
    line.floor.write("w", data, source=99)


async def position(line: SimulatedBus, address: str) -> int:
    await asyncio.sleep(2.0)
    return int((await line.send(address, "PR P"))[0])


@for_each("em, ck, foreign", [(em, ck, text) for em in range(4) for ck in (0, 1) for text in FOREIGN])
async def test_an_error_from_before_a_move_is_an_old_one_and_the_move_is_done(em, ck, foreign):
    line = await SimulatedBus(ALONE.format(em, ck)).open()
    other(line, foreign.encode())
    await asyncio.sleep(0.5)
    came = await outcome(line, "", "MR 100")
    assert await position(line, "") == 100
    assert came == "done", line.said
    assert "an old error, now cleared" in line.said or ck  # what has no checksum is only damaged
    await line.bus.close()


@for_each(
    "em, name, foreign, at",
    [
        (em, name, foreign, at / 1000)
        for em in (0, 1, 3)  # with EM=2 a drive shows nothing: the flag is read right before a move
        for name in ("", "a")
        for foreign in ("AT", "VM=99999999999", "MS=7")
        for at in range(0, 60, 7)
    ],
)
async def test_a_move_that_was_executed_is_never_called_refused(em, name, foreign, at):
    line = await SimulatedBus(party("a", EM=em, CK=0) if name else ALONE.format(em, 0)).open(*filter(None, [name]))
    loop = asyncio.get_running_loop()
    loop.call_later(at, other, line, f"{name}{foreign}".encode() + (b"\n" if name else b"\r"))
    came = await outcome(line, name, "MR 100")
    if await position(line, name):
        assert came != "refused", line.said
    await line.bus.close()


@for_each(
    "em, name, foreign, at",
    [
        (em, name, text, at / 1000)
        for em in range(4)
        for name in ("", "a")
        for text in FOREIGN
        for at in (0, 14, 28, 49)
        if em != 2 or "=" not in text  # an error that the setting can have, within the ms behind the reading of EF
    ],
)
async def test_a_setting_that_was_executed_is_never_called_refused(em, name, foreign, at):
    line = await SimulatedBus(party("a", EM=em, CK=0) if name else ALONE.format(em, 0)).open(*filter(None, [name]))
    loop = asyncio.get_running_loop()
    loop.call_later(at, other, line, f"{name}{foreign.strip()}".encode() + (b"\n" if name else b"\r"))
    try:
        await line.send(name, "VM=500000")
        certainly = False
    except DriveError as error:
        certainly = isinstance(error, Refused) and error.certain
    await asyncio.sleep(2.0)
    [device] = line.devices.values()
    if device.memory.values["VM"] == 500000:
        assert not certainly, line.said
    await line.bus.close()


@for_each("foreign, text", [(foreign, text) for foreign in FOREIGN for text in ("MR 100", "VM=500000", "R1=5", "S")])
async def test_the_error_of_another_client_of_a_drive_on_the_network_is_an_old_one(foreign, text):
    line = await SimulatedBus(ETHERNET, baud=0).open()
    [device] = line.devices.values()
    device.execute(foreign.strip(), line.floor.now())  # its reply goes to that client
    assert device.memory.error_flag
    assert await outcome(line, "", text) == "done" and "an old error, now cleared" in line.said
    await line.bus.close()


async def test_a_refusal_of_ours_stays_one():
    line = await SimulatedBus(ALONE.format(1, 0)).open()
    other(line, b"AT\r")
    await asyncio.sleep(0.5)
    assert await outcome(line, "", "VM=99999999999") == "refused"
    assert await outcome(line, "", "EX ZZ") == "refused"
    await line.bus.close()


FRAMED = {
    "pmx": (pmx("00"), "00", ("X-100000000000", "ZZZ", "HSPD=99999999999"), "INC", "X100", "PX"),
    "tmcl": (drive("TMCM", "1"), "1", ("SAP 4, 0, 99999999", "MVP ABS, 9, 5"), "", "MVP REL, 0, 100", "GAP 1, 0"),
}


@for_each("family, at", [(family, at / 1000) for family in FRAMED for at in range(0, 60, 3)])
async def test_in_the_other_families_a_move_that_was_executed_is_never_called_refused(family, at):
    cell, address, foreign, first, move, place = FRAMED[family]
    for text in foreign:
        line = SimulatedBus(cell, family=family)
        await line.bus.identify(Hints(family=family, drives=(address,)))
        drive_ = line.bus.drives[address]
        if first:
            await line.send(address, first)
        codec = drive_.state.codec
        if family == "pmx":
            data = f"@{address}{text}\r".encode()
        else:
            from multidrop.families.tmcl.host.codec import frame_of
            from multidrop.families.tmcl.manual import commands

            call = commands.parsed(text)
            assert call is not None
            data = frame_of(1, call)
        assert codec.family == family
        asyncio.get_running_loop().call_later(at, other, line, data)
        came = await outcome(line, address, move)
        await asyncio.sleep(2.0)
        try:
            moved = int((await line.send(address, place))[0])
        except DriveError:
            moved = int((await line.send(address, place))[0])
        if moved:
            assert came != "refused", (text, line.said)
        await line.bus.close()
