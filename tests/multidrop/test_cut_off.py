"""Sessions that are killed, pulled out or cut in two, on a real pseudo-terminal: what the next one finds and does.

`MULTIDROP_KILLS` is how many downloads are killed, each at another moment.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.front_door import Home
from tests.support.served_cell import until
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

KILLS = int(os.environ.get("MULTIDROP_KILLS", "2"))
PROGRAM = "VA Q1=5\nVM=400000\nPG 1\nLB G1\n" + "".join(f"R1={number}\n" for number in range(40)) + "E\nPG\nS\n"


def cell(baud: int, party: bool) -> str:
    drive = '[[bus.drive]]\npersonality = "LMDCM"\n'
    named = f"party = {str(party).lower()}\nset = {{ EM = 1, CK = {int(party)} }}\n"
    return (
        f'[[bus]]\nname = "w"\nserve = ["pty:w.tty", "tcp://127.0.0.1:0"]\nbaud = {baud}\n'
        + f'{drive}name = "{"a" if party else "!"}"\n{named}'
    )


class Floor(Home):
    """A simulated drive on a pseudo-terminal, and somebody who counts what it says."""

    def __init__(self, folder, baud=38400, party=True):
        super().__init__(folder)
        self.file("p.mxt", PROGRAM)
        self.serve(cell(baud, party))
        self.listener = socket.create_connection(("127.0.0.1", self.port("w")))
        self.url = f"{folder / 'w.tty'}?baud={baud}&timeout=3" + ("&drives=a&party=1" if party else "&party=0")

    def heard(self, process, enough=None):
        """How many bytes the drive says until the process ends, or (`enough`) until they are so many."""
        heard, ends = 0, time.monotonic() + PATIENCE
        while enough is None or heard < enough:
            assert time.monotonic() < ends
            self.listener.settimeout(0.2)
            try:
                heard += len(self.listener.recv(1 if enough else 4096))
            except TimeoutError:
                if process.poll() is not None:
                    break
        return heard

    def silent(self):
        """Pass over what the drive has said."""
        self.listener.settimeout(0.2)
        try:
            while self.listener.recv(4096):
                pass
        except TimeoutError:
            return

    def ask(self, *lines):
        """What a new session prints for these lines, and what it says besides."""
        code, out, err = self.process("send", self.url, *lines)
        assert code == 0, err
        return out.split("\n")[:-1], err

    def kept(self):
        return sorted(path.name for path in (self.folder / "state" / "ports").glob("*.json"))

    def close(self):
        self.listener.close()
        super().close()


@pytest.fixture
def floor(tmp_path):
    made = []

    def make(**how):
        made.append(Floor(tmp_path, **how))
        return made[-1]

    yield make
    for each in made:
        each.close()


@pytest.mark.timeout(120 + 60 * KILLS)
def test_after_a_download_that_is_killed_the_next_session_finds_the_drive_as_it_was(floor):
    line = floor()
    download = ("program", "download", line.url, "p.mxt", "--no-verify")
    sizes = []
    for _ in range(2):  # the second one also reads for its backup what the first one has stored
        line.silent()
        whole = line.start(*download)
        sizes.append(line.heard(whole))
        assert whole.wait(PATIENCE) == 0 and line.kept() == []
    size, backup = sizes[0], sizes[1] - sizes[0]
    owed = put_back = named = 0
    for number in range(KILLS):
        line.silent()
        loading = line.start(*download)
        line.heard(loading, enough=backup + size * (number + 1) // (KILLS + 1))
        loading.send_signal(signal.SIGKILL)
        loading.communicate()
        owed += bool(line.kept())
        line.silent()
        printed, said = line.ask("PR EM", "PR P", "PR MV")
        assert (printed, line.kept()) == (["1", "0", "0"], []), (number, said)
        put_back += "a: an interrupted download or program mode left EM=0; EM=1 is set again" in said
        if found := re.search(r"a: the download of p.mxt was cut off with its session; .* is in (/.*)", said):
            named += "multidrop backup of w.tty, drive a" in Path(found[1]).read_text()
    assert owed >= put_back >= KILLS // 2 and named >= put_back


CLIENT = """import os, signal, sys
fd = os.open(sys.argv[1], os.O_RDWR)
os.write(fd, sys.argv[2].encode())
print(1, flush=True)
signal.pause()
"""


@pytest.mark.parametrize("party", [True, False])
def test_half_a_line_of_another_program_that_was_killed_is_not_executed(floor, party):
    line = floor(party=party)
    line.ask("PR P")
    half = "aMR 5" if party else "MR 5"
    client = subprocess.Popen([sys.executable, "-c", CLIENT, str(line.folder / "w.tty"), half], stdout=subprocess.PIPE)
    assert client.stdout.readline() == b"1\n"
    client.kill()
    client.communicate()
    line.silent()
    printed, said = line.ask("PR P", "PR MV")
    assert printed == ["0", "0"] and "overflow" not in said


def test_a_plug_that_is_pulled_in_the_middle_of_a_line_has_the_next_session_make_it_overflow(floor):
    line, long = floor(baud=1200), f"MR{50 * ' '}51200"  # which takes half a second
    shell = line.start("shell", line.url)
    shell.stdin.write(f"{long}\n")
    shell.stdin.flush()
    until(
        lambda: any(b"MR" in path.read_bytes() for path in line.folder.glob("state/ports/*.line")), "it does not come"
    )
    line.sim.say("/sim unplug w")
    assert shell.wait(PATIENCE) == 3
    line.sim.say("/sim plug w")
    until(lambda: (line.folder / "w.tty").exists(), "it does not come")
    printed, said = line.ask("PR P", "PR MV")
    assert printed == ["0", "0"]
    assert f"was interrupted while it sent 'a{long}'" in said
    assert line.ask("PR P")[1] == ""
