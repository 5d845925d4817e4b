"""The prompt in a real terminal, on a simulated cell."""

import os
import sys

import pexpect
import pytest

from tests.support.paths import ROOT
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process


@pytest.fixture
def terminal(tmp_path):
    environment = os.environ | {
        "PYTHONPATH": str(ROOT),
        "MULTIDROP_CONFIG_DIR": str(tmp_path / "config"),
        "MULTIDROP_STATE_DIR": str(tmp_path / "state"),
        "TERM": "xterm",
        "PROMPT_TOOLKIT_NO_CPR": "1",
    }
    started = []

    def start(*arguments):
        command = ["-m", "multidrop", *arguments]
        child = pexpect.spawn(
            sys.executable,
            command,
            cwd=tmp_path,
            env=environment,
            timeout=PATIENCE,
            encoding="utf-8",
            dimensions=(24, 80),
        )
        started.append(child)
        return child

    yield start
    for child in started:
        child.close(force=True)


def test_a_person_works_at_the_prompt_and_stops_with_one_key(terminal):
    child = terminal("shell", "sim:#press")
    child.expect("a>")
    for line in ("MR 51200", "/wait stopped", "PR P"):
        child.send(f"{line}\r")
    child.expect("51200\r")
    child.send("/use b\r")
    child.expect("b>")
    child.send("SL 5000\r")
    child.send("\x18")
    child.expect("Ctrl.X: stop sent to every drive")
    child.expect("b: stopped, velocity 0")
    child.send("\x04")
    child.expect(pexpect.EOF)
    child.close()
    assert child.exitstatus == 0


def test_what_cannot_be_opened_ends_the_prompt_before_it_begins(terminal):
    child = terminal("shell", "/dev/does-not-exist")
    child.expect("/dev/does-not-exist")
    child.expect(pexpect.EOF)
    child.close()
    assert child.exitstatus == 3


def test_a_signal_ends_the_prompt(terminal):
    child = terminal("shell", "sim:#press")
    child.expect("a>")
    child.send("/record m\r")
    child.expect("recording m; /record stop ends it")
    child.kill(15)
    child.expect(pexpect.EOF)
    child.close()
    assert child.exitstatus == 130
