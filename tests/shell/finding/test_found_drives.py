"""A drive that was found, in words, as facts, and as the URL that opens it with those of its language and mode."""

from __future__ import annotations

from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import FAMILIES
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.shell.connect.urls import parse
from multidrop.shell.finding.scanning import FoundDrive, Scanning, url_of
from tests.support.cases import for_each


def found(url: str, address: str = "", family: str = "mcode", party: bool = False, **known: str) -> FoundDrive:
    codec: Any = MCode(party=party) if family == "mcode" else FAMILIES[family].codec
    state = FAMILIES[family].new_state(codec, address)
    for name, value in known.items():
        setattr(state, name, value)
    connection = parse(url)
    return FoundDrive(connection, connection.scheme.shown(connection), state)


PORTS = {
    "/dev/ttyUSB9": "/dev/ttyUSB9",
    "tcp://host:4000": "tcp://host:4000",
    "tcp://[fe80::1]:4000": "tcp://[fe80::1]:4000",
    "udp://10.0.0.5:503": "udp://10.0.0.5:503",
    "rfc2217://host:4000": "rfc2217://host:4000",
    "sim:cell.toml": "sim:cell.toml",
    "sim:cell.toml#press": "sim:cell.toml#press",
    "ssh://me@host/dev/ttyUSB0": "ssh://me@host/dev/ttyUSB0",
}


@for_each("url, port", PORTS.items())
def test_a_port_is_named_without_its_keys(url: str, port: str) -> None:
    connection = parse(url)
    assert connection.scheme.shown(connection) == port


@for_each(
    "url, bus, port",
    [
        ("sim:cell.toml", "press", "sim:cell.toml#press"),
        ("sim:cell.toml#other", "press", "sim:cell.toml#other"),
        ("/dev/ttyUSB9", "press", "/dev/ttyUSB9"),
    ],
)
def test_only_a_bus_of_a_cell_is_a_part_of_its_port(url: str, bus: str, port: str) -> None:
    connection = parse(url)
    assert connection.scheme.shown(connection, bus) == port


TTY = "/dev/ttyUSB9?baud=9600"
A = "serial:/dev/ttyUSB9?baud=9600&party=1&drives=a"
URLS: list[tuple[list[FoundDrive], str]] = [
    ([found(TTY)], "serial:/dev/ttyUSB9?baud=9600&party=0"),
    ([found(TTY, "a", party=True)], "serial:/dev/ttyUSB9?baud=9600&party=1&drives=a"),
    ([found(TTY, "a", party=True), found(TTY, "k", party=True)], "serial:/dev/ttyUSB9?baud=9600&party=1&drives=a,k"),
    ([found(TTY, "a", party=True), found("/dev/ttyUSB9?baud=19200", "k")], A),
    ([found(TTY, "a", party=True), found("/dev/ttyUSB8?baud=9600", "k")], A),
    ([found(TTY, "a", party=True), found(TTY, "05", "pmx")], "serial:/dev/ttyUSB9?baud=9600&party=1&drives=a"),
    ([found(TTY, "05", "pmx")], "serial:/dev/ttyUSB9?baud=9600&dialect=pmx&drives=05"),
    ([found(TTY, "", "pmx")], "serial:/dev/ttyUSB9?baud=9600&dialect=pmx&address=none"),
    ([found("/dev/ttyUSB9?baud=9600&echo=local")], "serial:/dev/ttyUSB9?baud=9600&party=0&echo=local"),
    ([found("tcp://host:4000", "a", party=True)], "tcp://host:4000?party=1&drives=a"),
    ([found("sim:cell.toml#press", "a", party=True)], "sim:cell.toml?party=1&drives=a#press"),
    ([found("udp://10.0.0.5:503", "a")], "udp://10.0.0.5:503?drives=a"),
]  # fmt: skip


@for_each("drives, url", URLS)
def test_the_url_opens_the_first_drive_and_those_like_it(drives: list[FoundDrive], url: str) -> None:
    assert url_of(drives) == url
    assert parse(url).target == drives[0].connection.target
    assert drives[0].url == url_of(drives[:1])


def test_the_facts_of_a_drive_are_those_of_its_port_its_state_and_its_modes() -> None:
    drive = found(TTY, "a", party=True, name="a", product="LMDCM", version="6.002", serial="77", part="LMDCM573")
    assert drive.facts() == {
        "port": "/dev/ttyUSB9",
        "baud": 9600,
        "dialect": "mcode",
        "address": "a",
        "name": "a",
        "product": "LMDCM",
        "part": "LMDCM573",
        "version": "6.002",
        "serial": "77",
        "party": True,
        "checksum": drive.state.codec.checksum,  # type: ignore[attr-defined]
        "em": drive.state.codec.em,  # type: ignore[attr-defined]
        "escape": drive.state.codec.escape,  # type: ignore[attr-defined]
        "url": "serial:/dev/ttyUSB9?baud=9600&party=1&drives=a",
    }
    assert found(TTY, "05", "pmx").facts()["party"] is None


WORDS: list[tuple[FoundDrive, str]] = [
    (found(TTY, "05", "pmx", product="PMX-2ED", version="112"), "/dev/ttyUSB9  9600 baud  05  PMX-2ED  112"),
    (found(TTY, "", "pmx", product="PMX", version="PMX 112"), "/dev/ttyUSB9  9600 baud  -  PMX 112"),
    (found("tcp://host:4000", "", "pmx", name="x", part="P1", serial="7"), "tcp://host:4000  (x)  part P1  serial 7"),
    (found("tcp://host:4000", "y", "pmx", name="x"), "tcp://host:4000  y"),
]


@for_each("drive, words", WORDS)
def test_a_drive_is_one_line_of_what_is_known(drive: FoundDrive, words: str) -> None:
    assert drive.words() == words


def test_the_modes_of_a_drive_come_last() -> None:
    drive = found(TTY, "a", party=True)
    assert drive.words() == f"/dev/ttyUSB9  9600 baud  a  {drive.state.codec.shown}"  # type: ignore[attr-defined]
    assert "PY=1" in drive.words()


def test_nothing_is_searched_on_a_port_whose_drive_has_its_own_address() -> None:
    nothing: Any = None
    with pytest.raises(Diagnostic, match=r"scan searches for .+ and \w+ drives; open it instead"):
        Scanning(nothing, nothing, parse("modbus://10.0.0.5"), lambda _: None)
