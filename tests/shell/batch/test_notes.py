"""What is found at opening is a warning on standard error, however the drives are worked with: real processes."""

import json
import socket
import subprocess
import sys

import pytest

from tests.support.processes import Running, environment
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

CELL = """
[[bus]]
name = "press"
serve = ["tcp://127.0.0.1:0"]
baud = 0
[[bus.drive]]
personality = "LMDCM"
set = { EM = 2 }
[[bus]]
name = "storing"
serve = ["tcp://127.0.0.1:0"]
baud = 0
[[bus.drive]]
personality = "LMDCM"
"""


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shop")
    (folder / "cell.toml").write_text(CELL)
    sim = Running("sim", "cell.toml", "--json", folder=folder)
    told = [json.loads(line) for line in sim.until('{"ready": true}')[:-1]]
    yield folder, {each["bus"]: each["endpoint"] for each in told}
    sim.process.terminate()
    assert sim.end() == 0


def done(folder, *arguments, stdin=""):
    command = [sys.executable, "-m", "multidrop", *arguments]
    ended = subprocess.run(
        command, input=stdin, capture_output=True, text=True, timeout=PATIENCE, cwd=folder, env=environment(folder)
    )
    return ended.returncode, ended.stdout, ended.stderr


@pytest.mark.parametrize("door", ["send", "run", "shell"])
def test_an_echo_mode_that_hides_losses_and_an_old_error_are_told(shop, door):
    folder, urls = shop
    url = urls["press"]
    (folder / "one.txt").write_text("R1=5\nPR R1\n")
    doors = {"send": ["send", url, "R1=5", "PR R1"], "run": ["run", "one.txt", "--on", url], "shell": ["shell", url]}
    host, port = url.removeprefix("tcp://").split(":")
    with socket.create_connection((host, int(port)), PATIENCE) as wire:  # somebody else's error
        wire.sendall(b"QQ 5\rPR 3\r")
        while not wire.recv(100).startswith(b"3"):
            pass
    code, out, err = done(folder, *doors[door], stdin="R1=5\nPR R1\n" if door == "shell" else "")
    assert (code, out) == (0, "5\n")
    assert "EM=2 cannot distinguish a lost command from an executed one" in err
    assert "its error flag is set (EF=1)" in err
    assert "an old error, now cleared: error 60" in err


def test_a_drive_that_was_left_in_program_mode_is_told(shop):
    folder, urls = shop
    url = urls["storing"]
    code, _, err = done(folder, "send", url, "PG 900")
    assert code == 0 and err == ""
    code, out, err = done(folder, "send", url, "PR 7")
    assert (code, out) == (0, "7\n")
    assert "was in program mode" in err and err.count("\n") == 1
