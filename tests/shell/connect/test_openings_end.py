"""A device that sends all the time: an opening, and the first line behind a lazy one, end in time and say what came."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from multidrop.base.errors import DriveError, TransportLost
from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from tests.support.cases import for_each
from tests.support.talker import Talker
from tests.support.tuned_ports import lead_to

pytestmark = pytest.mark.virtual
FOLDERS = itertools.count()
PORT = "/dev/ttyUSB9"


URLS = [
    PORT,
    f"{PORT}?party=0",
    f"{PORT}?drives=a",
    f"{PORT}?party=1&drives=a",
    f"{PORT}?drives=a,b",
    f"{PORT}?party=0&checksum=1",
    "tcp://10.0.0.5?drives=a,b",
    f"{PORT}?dialect=pmx",
    f"{PORT}?dialect=pmx&address=none",
    f"{PORT}?dialect=tmcl",
    "modbus://10.0.0.5",
    "tcp://10.0.0.5?dialect=pmx",
    "tcp://10.0.0.5",
]
LIMIT = 12.0
"""The limit of an opening with one drive, s, and of the first line behind a lazy one."""


@for_each(
    "url, says, every, lazy",
    [
        (url, says, every, lazy)
        for url in URLS
        for says, every in (
            (b"12345\r\n", 0.02),
            (b"12345\r\n", 0.3),
            (b"x", 0.01),
            (b"\r\n", 0.02),
            (b"?\r", 0.05),
            (b"PR P\r\n>", 0.011),
            (b"\r\n>", 0.15),
            (b"~", 0.9),
            (b"\x15>", 0.1),
        )
        for lazy in (False, True)
    ],
)
async def test_an_opening_and_the_first_line_end_within_one_limit(tmp_path, monkeypatch, url, says, every, lazy):
    async def transport(connection: Any, port: str = "", within: Any = None, baud: Any = None) -> Any:
        return Talker(says, every)

    lead_to(monkeypatch, transport)
    folder = tmp_path / str(next(FOLDERS))
    session: Any = Session(Settings({}, folder / "c", folder / "s", data=folder / "d"), lazy=lazy)
    began = session.now()
    with pytest.raises((DriveError, TransportLost)) as caught:
        await session.open(url)
        await session.run("PR P" if "dialect" not in url else "PX" if "pmx" in url else "GAP 1, 0")
    took = session.now() - began
    await session.close()
    assert took < LIMIT + 4.0 * (url.count(",") and not lazy) + 0.5, (took, str(caught.value))
    if says[:1].isdigit():
        assert "12345" in str(caught.value) or "31 32 33 34 35" in str(caught.value), str(caught.value)
