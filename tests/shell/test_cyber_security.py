"""A port that opens and is silent, or refuses every value, and the messages that name cyber security."""

import pytest

from multidrop.base.errors import NoAnswer, Refused
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from tests.support.cell_session import ETHERNET, bus, drive, session_on

pytestmark = pytest.mark.virtual

NAMED = "cyber security may be on"
PROTECTED = bus("eth", ETHERNET + "\ncse = true", baud=0)
SLOW = bus("eth", ETHERNET, baud=0) + "[bus.faults]\ndelay = [1.4, 1.5]\n"


async def failure(folder, cell, *lines, options=""):
    """The message of the last line, which fails."""
    async with session_on(folder, cell, opened=False) as made:
        with pytest.raises((NoAnswer, Refused)) as caught:
            await made.open(f"sim:{folder}/cell.toml{options}#eth")
            for number, line in enumerate(lines):
                try:
                    await made.run(line)
                except Refused:
                    if number == len(lines) - 1:
                        raise
    return str(caught.value)


@pytest.mark.parametrize("sent", [b"PR P\r", b"VM=5\r", b"\x1b", b"\r\n"])
def test_a_protected_unit_takes_no_bytes_and_sends_none_on_any_port(sent):
    floor = Floor(read(PROTECTED))
    [placed] = floor.drives
    placed.unit.port.receive(sent, 0.0)
    assert placed.unit.port.sent(1.0) == []
    assert placed.unit.connect is not None
    assert placed.unit.connect().receive(bytes.fromhex("0001 0000 0006 01 03 0057 0002"), 1.0) == b""


@pytest.mark.parametrize("line", ["PR P", "VM=200000"])
async def test_silence_from_the_start_names_it(tmp_path, line):
    assert NAMED in await failure(tmp_path, PROTECTED, line)


async def test_a_slow_drive_is_not_named(tmp_path):
    assert NAMED not in await failure(tmp_path, SLOW, "PR P")


async def test_a_party_line_and_a_serial_drive_are_not_named(tmp_path):
    assert NAMED not in await failure(tmp_path, PROTECTED, "PR P", options="?drives=a,b")
    serial = bus("eth", drive("LMDCM"), baud=9600) + "[bus.faults]\ndrop = 1.0\n"
    assert NAMED not in await failure(tmp_path, serial, "PR P")


async def test_two_values_refused_and_none_taken_name_it(tmp_path):
    plain = bus("eth", ETHERNET, baud=0)
    text = await failure(tmp_path, plain, "VM=5", "A=1")
    assert NAMED in text and "every value so far was refused" in text
    for lines in (["VM=5"], ["VM=5", "VM=6"], ["VM=5", "R1=3", "A=1"], ["R1=3", "VM=5", "A=1"], ["VM=5", "NO"]):
        assert NAMED not in await failure(tmp_path, plain, *lines), lines
    assert NAMED not in await failure(tmp_path, bus("eth", drive("LMDCM"), baud=0), "VM=5", "A=1")
