"""Clients that other people wrote for real units, run unchanged against `multidrop sim`.

The packages come from PyPI; where they cannot be had the tests are skipped. What other clients are known to write and
to expect is here as bytes.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from tests.support.foreign_python import foreign_python
from tests.support.paths import SUPPORT
from tests.support.processes import Running
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

PACKAGES = ("pymdrive==1.0.0", "dvg-devices==1.8.1")
NEEDED = ("dvg-debug-functions==2.5.0", "numpy", "pyserial==3.5", "telnetlib3==5.0.1", "wcwidth")
"""What the parts of them need that are used here."""


@pytest.fixture(scope="module")
def python() -> Path:
    """A Python that has the packages."""
    return foreign_python(*PACKAGES, *NEEDED)


def serve(cell: str, folder: Path) -> Running:
    (folder / "cell.toml").write_text(cell)
    running = Running("sim", "cell.toml", "--json", folder=folder)
    running.until('{"ready": true}')
    return running


def run(python: Path, script: str, port: Path) -> dict[str, object]:
    """What a client's script says, which is JSON on its last line."""
    done = subprocess.run(
        [str(python), str(SUPPORT / script), str(port)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        cwd=port.parent,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    facts = json.loads(done.stdout.splitlines()[-1])
    assert isinstance(facts, dict)
    return facts


AXES = """
[[bus]]
name = "line"
serve = ["pty:line.tty"]
baud = 9600
[[bus.drive]]
personality = "LMDCM"
name = "X"
party = true
[[bus.drive]]
personality = "LMDCM"
name = "Y"
party = true
set = { IS = ["3,3,0"] }
[bus.drive.world]
limit_minus = -30000
"""


def test_pymdrive_finds_no_surprise(python: Path, tmp_path: Path) -> None:
    running = serve(AXES, tmp_path)
    try:
        with serial.Serial(str(tmp_path / "line.tty"), 9600) as port:
            port.write(b"\n")  # the units have been on for a while: the line feed that party mode waits for has come
        facts = run(python, "client_pymdrive.py", tmp_path / "line.tty")
    finally:
        running.kill()
    listed = facts.pop("all")
    assert facts == {
        "set": [400000, 2000000, 768000],
        "moving": [True, False],
        "moved": 461800,
        "homed": [0, True, False],
        "aborted": [True, True],
        "stopped": False,
        "warned": [],
    }
    assert isinstance(listed, list) and 'DN = "X"' in listed and "VM = 400000" in listed
    assert running.errors == []


STAGES = """
[[bus]]
name = "stages"
serve = ["pty:stages.tty"]
baud = 9600
[[bus.drive]]
personality = "MDI"
name = "x"
party = true
program = "x.mxt"
[bus.drive.world]
home = -25600
limit_plus = 2048000
[[bus.drive]]
personality = "MDI"
name = "z"
party = true
program = "z.mxt"
"""


def test_dvg_devices_finds_no_surprise(python: Path, tmp_path: Path) -> None:
    """Its example programs are stored in the drives as its pages say, and run in the background all the time."""
    (folder,) = python.parent.parent.glob("lib/python*/site-packages/dvg_devices")
    for name in "xz":
        program = (folder / f"MDrive_example_motion_program_{name}.mxt").read_bytes()
        (tmp_path / f"{name}.mxt").write_bytes(program)
    running = serve(STAGES, tmp_path)
    try:
        facts = run(python, "client_dvg.py", tmp_path / "stages.tty")
    finally:
        running.kill()
    assert facts == {
        "connected": True,
        "found": ["x", "z"],
        "variables": {"C0": 51200, "CT": 0, "L1": 3, "L2": 2},
        "labels": ["F1", "F2", "FH", "M0", "MM", "SU"],
        "config": [256000, "2, 1, 0", "3.010"],
        "moved": [True, 51200],
        "slews": [True, True, True, True],
        "refused": [True, True, True, 23],
        "runs": [True, True],
        "stopped": [True, False, True, False],
        "homed": [True, 0],
        "errors": [True, 0],
        "saved": True,
    }
    assert running.errors == []


# What clients are known to write and to expect, byte for byte.

LEXIUM = b"Copyright\xa9 2010 Schneider Electric Motion USA\r\n"
MDRIVE = b"Copyright\xa9 2001-2009 by Intelligent Motion Systems, Inc.\r\n>"
BUSES = {
    "full": '[[bus.drive]]\npersonality = "LMDCM"\nset = { VM = 2000000, A = 1000000000 }\n',
    "half": '[[bus.drive]]\npersonality = "LMDCM"\nset = { EM = 1 }\n',
    "mute": '[[bus.drive]]\npersonality = "LMDCM"\nset = { EM = 2 }\n',
    "sums": '[[bus.drive]]\npersonality = "LMDCM"\nset = { EM = 1, CK = 1 }\n',
    "old": '[[bus.drive]]\npersonality = "MDI"\n',
    "line": "".join(
        f'[[bus.drive]]\npersonality = "LMDCM"\nname = "{name}"\nparty = true\nset = {{ EM = {em} }}\n'
        for name, em in (("1", 1), ("x", 0), ("y", 1))
    ),
}


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder with the ports of the units."""
    folder = tmp_path_factory.mktemp("units")
    cell = "".join(f'[[bus]]\nname = "{name}"\nserve = ["pty:{name}.tty"]\n{drives}' for name, drives in BUSES.items())
    running = serve(cell, folder)
    yield folder
    running.kill()
    assert running.errors == []


def sealed(text: bytes) -> bytes:
    """A text and its checksum: two's complement of the sum, bit 7 set."""
    return text + bytes([(-sum(text) & 0x7F) | 0x80])


def heard(port: serial.Serial, length: int) -> bytes:
    """So many bytes, or what came of them in time."""
    return bytes(port.read(length))


CONVERSATIONS: dict[str, tuple[str, list[tuple[bytes, bytes]]]] = {
    "full duplex": (
        "full",
        [
            (b"PR P\r", b"PR P\r\n0\r\n>"),
            (b"P=100\r\n", b"P=100\r\n>\n"),
            (b"PR P\r", b"PR P\r\n100\r\n>"),
            (b"MS=7\r", b"MS=7\r\n?"),
            (b"PR ER\r", b"PR ER\r\n21\r\n>"),
            (b"MA 0,1\r", b"MA 0,1\r\n>!\r\n"),
            (b"\x1b", b"#\r\n>"),
            (b"\x03", LEXIUM),
        ],
    ),
    "blanks and equals signs are the same": (
        "full",
        [(b"VI 2000\r", b"VI 2000\r\n>"), (b"VI=1000\r", b"VI=1000\r\n>"), (b"HM=1,0\r", b"HM=1,0\r\n?")],
    ),
    "a download": (
        "full",
        [
            (b"ER=0\r", b"ER=0\r\n>"),
            (b"PG 1\r", b"PG 1\r\n1  "),
            (b"HM 1\r", b"HM 1\r\n5  "),
            (b"H\r", b"H\r\n7  "),
            (b"P=30000\r", b"P=30000\r\n12  "),
            (b"E\r", b"E\r\n14  "),
            (b"PG\r", b"PG\r\n>"),
            (b"S\r", b"S\r\n>"),
            (b"CP\r", b"CP\r\n>"),
        ],
    ),
    "half duplex": (
        "half",
        [
            (b"P=5\r", b"\r\n"),
            (b"PR P\r", b"\r\n5\r\n"),
            (b"PR P,V\r", b"\r\n50\r\n"),
            (b"\x1b", b"\r\n"),
            (b"EM 0\r", b"\r\n"),
            (b"PR P\r", b"PR P\r\n5\r\n>"),
            (b"EM 1\r", b"EM 1\r\n>"),
            (b"PR EM\r", b"\r\n1\r\n"),
        ],
    ),
    "mute": ("mute", [(b"P=7\rPR P\r", b"7\r\n"), (b"\x1bP=8\rPR P\r", b"8\r\n")]),
    "an older unit": (
        "old",
        [
            (b"PR VR\r", b"PR VR\r\n3.010\r\n>"),
            (b"S1=3,1,0\r", b"S1=3,1,0\r\n>"),
            (b"PR S1\r", b"PR S1\r\n3, 1, 0\r\n>"),
            (b"VA C0=51200\r", b"VA C0=51200\r\n>"),
            (b"PR UV\r", b"PR UV\r\nC0 = G 51200\r\n\r\n>"),
            (b"\x03", MDRIVE),
        ],
    ),
    "a party": (
        "line",
        [
            (b"\n\nx\n", b"x\r\n>"),
            (b"y\n", b"\r\n"),
            (b"q\nx\n", b"x\r\n>"),
            (b"*P=3\r\nyPR P\r\n", b"\r\n3\r\n"),
            (b"xPR P\r\n", b"xPR P\r\n3\r\n>"),
            (b"1VI 900\r\n1VM 20000\r\n1A 30000\r\n1D=A\r\n1PR D\n", b"\r\n" * 4 + b"\r\n30000\r\n"),
            (b"yMA 4,1\n", b"\r\ny\r\n"),
            (b"X\nyPR P\n", b"\r\n4\r\n"),
        ],
    ),
    "checksums": (
        "sums",
        [
            (b"MR 1\x90\r", b"\x06"),
            (b"MR 51200\xc8\r", b"\x15"),
            (sealed(b"PR EM") + b"\r", b"\x06" + sealed(b"1") + b"\r\n"),
            (b"PR P\r", b"\x15"),
        ],
    ),
    "the rescue of a stuck unit": (
        "sums",
        [(b"\rCK=0\x85\r", b"\x15\r\n"), (b"PR CK\r", b"\r\n0\r\n"), (b"CK=1\r", b"\x06")],
    ),
}


@pytest.mark.parametrize("conversation", CONVERSATIONS)
def test_what_clients_write_is_answered_byte_for_byte(units: Path, conversation: str) -> None:
    bus, steps = CONVERSATIONS[conversation]
    with serial.Serial(str(units / f"{bus}.tty"), 9600, timeout=PATIENCE) as port:
        for written, expected in steps:
            port.write(written)
            assert heard(port, len(expected)) == expected, written
        port.timeout = 0.05
        assert heard(port, 1) == b"", "nothing more is said"
