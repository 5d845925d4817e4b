"""The prompt in a real terminal, on a simulated cell."""

import pytest

from tests.support.front_door import read_to_end

pytestmark = pytest.mark.process


def test_a_person_works_at_the_prompt_and_stops_with_one_key(home):
    child = home.terminal("shell", "sim:#press")
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
    assert read_to_end(child) == 0


def test_what_cannot_be_opened_ends_the_prompt_before_it_begins(home):
    child = home.terminal("shell", "/dev/does-not-exist")
    child.expect("/dev/does-not-exist")
    assert read_to_end(child) == 3


def test_a_signal_ends_the_prompt(home):
    child = home.terminal("shell", "sim:#press")
    child.expect("a>")
    child.send("/record m\r")
    child.expect("recording m; /record stop ends it")
    child.kill(15)
    assert read_to_end(child) == 130


def test_a_wait_is_named_after_a_second_of_silence(home):
    child = home.terminal("send", "sim:#press", "/sleep 2", "PR P")
    child.expect("running /sleep 2, 1 s")
    child.expect("\r0\r")
    assert read_to_end(child) == 0


def test_in_a_dumb_terminal_lines_are_typed_and_the_end_comes(home):
    child = home.terminal("shell", "sim:#press", TERM="dumb")
    child.expect("a> ")
    child.send("PR P\r")
    child.expect("\r\n0\r\n")
    child.send("/quit\r")
    assert read_to_end(child) == 0
    assert "\x1b" not in child.before
