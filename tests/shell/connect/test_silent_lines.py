"""A line that does not reply says what came and the causes, known or not, in every family and front end."""

from __future__ import annotations

import asyncio
import itertools
from typing import Any

import pytest

from multidrop.base.errors import DriveError
from multidrop.dialects.families import seen
from multidrop.dialects.state import Remembered
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.urls import parse
from multidrop.shell.session import Session
from multidrop.shell.state.port_state import PortState
from tests.support.cases import for_each
from tests.support.cell_session import CellSession, bus, drive, party, pmx
from tests.support.talker import Talker
from tests.support.tuned_ports import lead_to

pytestmark = pytest.mark.virtual
FOLDERS = itertools.count()
PORT = "/dev/ttyUSB9"
CAUSES = ("power", "name", "baud", "A and B", "termination", "direction")
LAST = Remembered("a", "a", "LMDCM", "LMDCM 6.002", "LMDCM571", "1", True, 0, 1)
URLS = [
    PORT,
    f"{PORT}?drives=a",
    f"{PORT}?party=1&drives=a",
    f"{PORT}?party=0",
    f"{PORT}?dialect=pmx",
    f"{PORT}?dialect=pmx&drives=07",
    f"{PORT}?dialect=tmcl&drives=3",
    "tcp://10.0.0.5?dialect=pmx",
    "tcp://10.0.0.5?party=1&drives=a",
]


async def failure(folder: Any, patch: Any, url: str, lazy: bool, remembered: bool, **device: Any) -> str:
    async def transport(connection: Any, port: str = "", within: Any = None, baud: Any = None) -> Any:
        return Talker(network=connection.scheme.name == "tcp", **device)

    lead_to(patch, transport)
    folder = folder / str(next(FOLDERS))
    if remembered:
        kept = PortState(folder / "s", parse(url).port_name, 9600)
        kept.remember({"a": LAST})
        kept.close()
    session: Any = Session(Settings({}, folder / "c", folder / "s", data=folder / "d"), lazy=lazy)
    try:
        with pytest.raises(DriveError) as caught:
            await session.open(url)
            await session.run("PX" if "pmx" in url else "GAP 1, 0" if "tmcl" in url else "PR P")
    finally:
        await session.close()
    return str(caught.value)


@for_each("url, lazy, remembered", itertools.product(URLS, (False, True), (False, True)))
async def test_a_silent_line_names_every_cause(tmp_path, monkeypatch, url, lazy, remembered):
    text = await failure(tmp_path, monkeypatch, url, lazy, remembered)
    assert text.count("nothing was received") == 1
    assert [each for each in CAUSES if each not in text] == []
    assert text.count("power") == 1 and "\n" not in text


@for_each("url, lazy", itertools.product(URLS, (False, True)))
async def test_noise_is_told_from_text_and_from_our_own_bytes(tmp_path, monkeypatch, url, lazy):
    noise = await failure(tmp_path, monkeypatch, url, lazy, False, says=b"\xff\xfe\x80", every=0.2)
    assert "bytes came, none of them readable: another baud rate?" in noise and "A and B" in noise, noise
    own = await failure(tmp_path, monkeypatch, url, lazy, False, repeats=True)
    assert "only our own bytes came back" in own and "power" in own, own


async def test_a_line_that_has_replied_is_not_doubted(tmp_path):
    async with CellSession(tmp_path, bus("b", party("a"), party("c"))) as cell:
        cell.world("power c off")
        with pytest.raises(DriveError) as caught:
            await cell.session.run("@c PR P")
        assert "A and B" not in str(caught.value) and "so far" not in str(caught.value)


MODULE = drive("TMCM", "1")


@for_each(
    "number, drives, line",
    [
        (1, [party("a")], "@b PR P"),
        (2, [party("a")], "@b MR 100"),
        (3, [pmx("00")], "@07 PX"),
        (4, [MODULE], "@7 GAP 1, 0"),
    ],
)
async def test_a_silent_drive_on_a_line_that_works_has_causes_of_its_own(tmp_path, number, drives, line):
    folder = tmp_path / str(number)
    folder.mkdir()
    async with CellSession(folder, bus("b", *drives)) as cell:
        with pytest.raises(DriveError) as caught:
            await cell.session.run(line)
    text = str(caught.value)
    assert [each for each in ("its power", "its name or address", "its baud rate") if each not in text] == [], text
    assert "A and B" not in text


@for_each(
    "url, lazy, says",
    [
        (f"{PORT}?drives=a", False, "a does not reply (MCode outside of party mode and in party mode was tried)"),
        (f"{PORT}?party=1&drives=a", False, "a does not reply; drives=NAMES names others"),
        (f"{PORT}?drives=a,b", False, "none of the drives a, b replies; drives=NAMES names others"),
    ],
)
async def test_the_names_that_were_given_are_not_advised_again(tmp_path, monkeypatch, url, lazy, says):
    text = await failure(tmp_path, monkeypatch, url, lazy, False)
    assert text.startswith(says) and "drives=a,b," not in text, text


async def test_one_byte_is_one(tmp_path, monkeypatch):
    text = await failure(tmp_path, monkeypatch, f"{PORT}?dialect=pmx", False, False, says=b"x", every=1.5)
    assert "1 byte came that is no reply ('x')" in text, text
    assert seen(b"\xff", "mcode") == "1 byte came, and is not readable: another baud rate?"


class Gateway(Talker):
    """A Modbus gateway that replies to each request with an exception."""

    def __init__(self, number: int) -> None:
        super().__init__(network=True)
        self.number = number

    def write(self, data: bytes) -> bool:
        reply = data[:4] + b"\x00\x03" + data[6:7] + bytes((data[7] | 0x80, self.number))
        asyncio.get_running_loop().call_soon(self._received, reply)
        return True


@for_each("number, says", [(10, "the gateway did not pass it on"), (11, "the gateway got no reply")])
async def test_a_gateways_own_words_are_followed_by_no_other_cause(tmp_path, monkeypatch, number, says):
    async def transport(connection: Any, port: str = "", within: Any = None, baud: Any = None) -> Any:
        return Gateway(number)

    lead_to(monkeypatch, transport)
    folder = tmp_path / str(next(FOLDERS))
    session: Any = Session(Settings({}, folder / "c", folder / "s", data=folder / "d"))
    with pytest.raises(DriveError, match=says) as caught:
        await session.open("modbus://10.0.0.5")
    await session.close()
    assert "A and B" not in str(caught.value) and "; ;" not in str(caught.value)
