"""The targets of the fuzzer: each takes bytes and may raise nothing. A finding is an exception, a hang or growth.

Targets are deterministic and read no clock. `tests/fuzz` runs each of them over its seeds and over what hypothesis
makes; `fuzz/run.py` searches with coverage as its guide.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import islice

from multidrop.base.errors import Diagnostic, DriveError
from multidrop.dialects import Request
from multidrop.dialects.codec import Codec
from multidrop.dialects.families import FAMILIES, program_languages
from multidrop.drives.line import Line
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.pmx.host.codec import Pmx
from multidrop.families.tmcl.host.codec import Tmcl
from multidrop.macros.model import Macro
from multidrop.macros.toml_format import format_macro, parse_macro, with_values
from multidrop.macros.vendor import exported, imported
from multidrop.shell import configuration, line_syntax
from multidrop.shell.connect import urls
from multidrop.simulator import cells
from multidrop.simulator.floor import Floor

Target = Callable[[bytes], object]
REPLY_LIMIT = 1 << 20
"""Largest reply of a port to one input of the fuzzer, bytes; a longer one is a leak."""

CODECS: tuple[Codec, ...] = (
    *(
        MCode(em=em, checksum=checksum, party=party)
        for em in range(4)
        for checksum in range(3)
        for party in (False, True)
    ),
    Pmx(),
    Tmcl(),
    FAMILIES["modbus"].codec,
)
LINES = ("PR P", "PR VR,EM", "MR 100", "L", "PR AL", "EM=1", "VA Q1", "PG 100", "PG", "S", "EX G1", "PR UV", "")
BINARY = {"tmcl": ("GAP 1, 0", "ROR 0, 1", "136 0, 0, 0"), "modbus": ("PR P", "MR 1", "SL 0")}
ADDRESSES = {"mcode": "a", "pmx": "00", "tmcl": "1", "modbus": ""}


def requests(codec: Codec) -> list[Request]:
    """The requests that a family's own conversations make of typed lines."""
    found: list[Request] = []
    family = FAMILIES[codec.family]
    address = ADDRESSES[codec.family] if getattr(codec, "party", True) else ""
    for line in BINARY.get(codec.family, LINES):
        try:
            asked = next(family(family.new_state(codec, address)).perform(line), None)
        except DriveError:
            continue
        if asked is not None:
            found.append(asked)
    return [*found, *(replace(each, expect=r"\d+", gather=True) for each in found[:2])]


ASKED = [(codec, each) for codec in CODECS for each in requests(codec)]


def decode(data: bytes) -> None:
    """A reply decoder, with any bytes in the buffer: whole, and byte by byte."""
    if len(data) < 2:
        return
    codec, request = ASKED[int.from_bytes(data[:2], "big") % len(ASKED)]
    buffer = data[2:]
    for end in (len(buffer), *range(1, min(len(buffer), 64))):
        part = buffer[:end]
        for found in (codec.decode(request, part), codec.on_quiet(request, part), codec.on_timeout(request, part)):
            assert found is None or 0 <= found.used <= len(part), (found, part)
        assert codec.quiet_time(request, part) >= 0
        lines, used = codec.parse_unsolicited(part)
        assert 0 <= used <= len(part)
        assert all(isinstance(line, str) for line in lines)


def line(data: bytes) -> None:
    """A line with requests in flight, to which anything arrives at any time."""
    if len(data) < 3:
        return
    codec, request = ASKED[int.from_bytes(data[:2], "big") % len(ASKED)]
    wire = Line(codec, local_echo=bool(data[2] & 1), timeout=0.5)
    now = 0.0
    for step in data[3:]:
        if step % 16 == 0:
            wire.ask(request)
        elif step % 16 == 1:
            now = max(now, wire.deadline or now)
        elif step % 16 == 2:
            wire.stop(now)
        else:
            wire.receive(bytes([step]), now)
        now += 0.001
        for event in wire.events(now):
            assert event is not None
    for _ in range(50):
        if (deadline := wire.deadline) is None:
            break
        now = max(now, deadline) + 1e-6
        wire.events(now)
    assert len(wire.inbox.buffer) <= REPLY_LIMIT


CELL = """
[[bus]]
name = "one"
[[bus.drive]]
personality = "{}"
"""
PERSONALITIES = ("LMDCM", "LMDCE", "LMM", "MDIX", "PMX", "TMCM")


def port(data: bytes) -> None:
    """A simulated drive, to which anything is sent."""
    if not data:
        return
    floor = Floor(cells.read(CELL.format(PERSONALITIES[data[0] % len(PERSONALITIES)])))
    now, answered = 0.0, 0
    for at in range(1, len(data), 16):
        floor.wires["one"].receive(data[at : at + 16], now)
        now += 0.02
        answered += sum(map(len, floor.advance(now).values()))
    for _ in range(50):
        if (deadline := floor.deadline) is None or deadline > now + 5:
            break
        now = max(now, deadline)
        answered += sum(map(len, floor.advance(now).values()))
    assert answered < REPLY_LIMIT, answered


def modbus_port(data: bytes) -> None:
    """The Modbus/TCP port of a simulated Ethernet drive, to which anything is sent."""
    connection = Floor(cells.read(CELL.format("LMDCE"))).own_port("one")
    answered = 0
    for number, at in enumerate(range(0, len(data), 16)):
        if connection.closed:
            break
        answered += len(connection.receive(data[at : at + 16], number * 0.02))
    assert answered < REPLY_LIMIT


def usb(data: bytes) -> None:
    """The messages of USB/IP, of both sides; then requests and packets to the USB side of a simulated controller."""
    from multidrop.features.usb.device import sides
    from multidrop.features.usb.interface import PACKET
    from multidrop.features.usb.usbip import Malformed, Transfers

    for answers in (False, True):
        messages = Transfers(answers)
        messages.wanted = {1, 2}
        with contextlib.suppress(Malformed):
            for each in messages.feed(data):
                assert each.pack()
    (side,) = sides(Floor(cells.read(CELL.format("PMX"))), "one")
    for number, at in enumerate(range(0, len(data), 8)):
        piece = data[at : at + 8]
        status, reply = side.request(piece.ljust(8, b"\0"))
        assert status <= 0 and len(reply) <= 255
        assert side.receive(piece, number * 0.02) == b""
    assert all(len(each) == PACKET for each in side.replies)


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _quietly(parse: Callable[[str], object]) -> Target:
    """A parser of a person's text: it may refuse with one line, and nothing else."""

    def target(data: bytes) -> None:
        try:
            parse(_text(data))
        except (Diagnostic, DriveError) as problem:
            assert str(problem)

    return target


def _macro(text: str) -> None:
    macro = parse_macro(text, "m.toml")
    assert isinstance(macro, Macro)
    assert parse_macro(format_macro(macro), "m.toml") == macro
    parse_macro(with_values(text, {"key": "F9"}, "m.toml"), "m.toml")


def _keys(text: str) -> None:
    """Import function-key strings; what can be exported again is imported as it was."""
    macros = imported(text, "keys.txt")
    with contextlib.suppress(Diagnostic):
        assert imported(exported(macros), "keys.txt", ["f9"]) == macros


def _cell(text: str) -> None:
    """Read a cell; build its drives where it is small."""
    cell = cells.read(text, "c.toml")
    if sum(len(bus.drives) for bus in cell.buses) < 8:
        Floor(cell).advance(0.1)


def _check(text: str) -> None:
    """Check a program file in every language, and rewrite it in canonical spelling."""
    for programs in program_languages().values():
        for problem in islice(programs.language.check(text, "LMDCM"), 1000):
            assert problem.what and problem.line >= 0
        spelled = programs.language.formatted(text)
        assert programs.language.formatted(spelled) == spelled
        try:
            programs.language.measure(text)
        except Diagnostic as problem:
            assert str(problem)


def _typed(text: str) -> None:
    """A typed line: parsed, then carried out as far as its first request in every family."""
    parsed = line_syntax.parse(text)
    if not isinstance(parsed, line_syntax.DriveLine):
        return
    for family in FAMILIES.values():
        state = family.new_state(family.codec, ADDRESSES[family.name])
        family.codec.starts_motion(parsed.text)
        family(state).guard(parsed.text)
        family.language.hint(parsed.text)
        family.language.complete(parsed.text)
        try:
            asked = next(family(state).perform(parsed.text), None)
            if asked is not None:
                assert family.codec.encode(asked)
        except DriveError as problem:
            assert str(problem)


def _world(text: str) -> None:
    """A line of `/sim`."""
    Floor(cells.demo()).command(text, 0.0)


TARGETS: Mapping[str, Target] = {
    "decode": decode,
    "line": line,
    "port": port,
    "modbus_port": modbus_port,
    "usb": usb,
    "url": _quietly(urls.parse),
    "configuration": _quietly(lambda text: configuration.parse(text, "multidrop.toml")),
    "cell": _quietly(_cell),
    "macro": _quietly(_macro),
    "keys": _quietly(_keys),
    "program": _quietly(_check),
    "typed": _quietly(_typed),
    "world": _quietly(_world),
}
SEEDS: Mapping[str, tuple[bytes, ...]] = {
    "decode": (b"\0\0PR P\r\n51200\r\n>", b"\1\2\x15\r\n", b"\2\x05a51200\x06\r\n", b"\0\x4051200\r"),
    "line": (b"\0\0\0\x0051200\r\n>", b"\1\1\1\x00\x01\x02\r\n"),
    "port": (b"\0PR P\rMR 100\r\x1b", b"\4@00PX\r", b"\5\x01\x04\0\0\0\0\0\0\x05", b"\1PG 100\rLB Ga\rE\rPG\rEX Ga\r"),
    "modbus_port": (bytes.fromhex("00010000000601030057 0002".replace(" ", "")),),
    "usb": (
        bytes.fromhex("00000001 00000001 00000000 00000000 00000002 00000000 00000003") + bytes(20) + b"PX\0",
        bytes.fromhex("00000003 00000001 00000000 00000000 00000000 00000000 00000003") + bytes(20) + b"12\0",
        bytes.fromhex("8006000100001200 4002010000000000") + b"V1=1234\0",
    ),
    "url": (
        b"/dev/ttyUSB0?drives=a,b&baud=9600",
        b"tcp://[::1]:503?party=1",
        b"sim:c.toml#press",
        b"usb:2ED01@1-1.4",
        b"usbip://[::1]:3240/1-1",
    ),
    "configuration": (b'[connections.a]\nurl = "sim:"\nnames = { a = "left" }\n',),
    "cell": (json.dumps("x").encode(), CELL.format("LMDCM").encode()),
    "macro": (b'name = "go"\nkey = "F3"\n[[step]]\nafter = 0.5\nline = "@b MR 100"\n',),
    "keys": (b"F2 MR 1^M^p^m^d20^r2 ; there\nF3 ^f2^[^MPR P^M^J\n",),
    "program": (
        b"PG 100\nLB Ga\nMR 100\nH\nBR Ga, P<1000\nE\nPG\n",
        b"SA0=V1=1\nEND\n",
        b"IF V1=1\nX1000\nENDIF\nEND\n",
    ),
    "typed": (b"@a MR 100", b'PR P," ",V', b"GAP 1, 0", b"X1000Y20", b"/wait stopped"),
    "world": (b"/sim input b 1 0", b"/sim power b off"),
}


def seeds(name: str) -> list[bytes]:
    """The seeds of a target, and its kept findings in `fuzz/findings/NAME`."""
    folder = os.path.join(os.path.dirname(os.path.abspath(__file__)), "findings", name)
    kept = []
    for file in sorted(os.listdir(folder)) if os.path.isdir(folder) else []:
        with open(os.path.join(folder, file), "rb") as found:
            kept.append(found.read())
    return [*SEEDS[name], *kept]
