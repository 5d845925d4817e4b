"""Keys of the prompt in the order of their bytes, the stop key before all of them: real ptys, a simulated drive."""

from __future__ import annotations

import os
import signal
import time

import pytest

from multidrop.shell.prompt.terminal_input import TYPING_PAUSE
from tests.support.cases import for_each
from tests.support.front_door import read_to_end
from tests.support.processes import Tap
from tests.support.served_cell import SIGNALS, ends, until

pytestmark = [pytest.mark.process, pytest.mark.pty]
PASTE = "\x1b[200~"


@pytest.fixture
def prompt(shop):
    child = shop.terminal("shell", "press")
    child.expect("b>")
    return child


@pytest.fixture
def silent():
    """A server that takes a connection and never answers."""

    def mute(client):
        while client.recv(4096):
            pass

    server = Tap(answer=mute)
    tap = Tap(("127.0.0.1", server.port))
    yield tap
    tap.close()
    server.close()


def stopped(child):
    child.expect("Ctrl.X: stop sent to every drive")
    child.expect("press: b: stopped, velocity 0")


def test_a_line_typed_before_the_stop_key_leaves_nothing_running(shop, prompt):
    line = "SL 50000\r"
    for apart in (0, 0.001, 0.005, 0.02):
        if apart:
            prompt.send(line)
            time.sleep(apart)  # the attack itself: so much later the key comes
            prompt.send("\x18")
        else:
            prompt.send(line + "\x18")
        stopped(prompt)
        assert shop.velocity() == 0, apart


@for_each("before", [PASTE + "MR 5\rMR 6", "\x1b", "\x1b[", "\x12search", "\x16", "half a line", "\xe2"])
def test_the_stop_key_is_found_whatever_was_typed_before_it(shop, prompt, before):
    prompt.send("SL 50000\r")
    until(lambda: shop.velocity() == 50000, "the drive does not move")
    os.write(prompt.fileno(), before.encode("latin-1") + b"\x18")
    stopped(prompt)
    if before.startswith(PASTE):
        prompt.send("MR 7\rMR 8")  # the rest of the paste is as old as what came before the stop
        prompt.expect("a paste has not ended; until it does, keys belong to it. Ctrl.C drops it")
        prompt.send("\x03")
        prompt.expect("the paste that did not end was dropped")
    prompt.send('PR "as"," new"\r')
    prompt.expect("as new\r")


def test_what_is_typed_before_the_stop_key_is_said_and_kept_and_what_comes_behind_is_a_line_of_its_own(prompt):
    prompt.send('/sleep 1000\rPR "one"\rMR 51')
    prompt.expect("MR 51")
    prompt.send('200\x18PR "be","hind"\r')
    prompt.expect("not sent, as a stop came: PR .one.")
    prompt.expect("not sent, as a stop came: MR 51200")
    prompt.expect("behind\r")
    prompt.send("\x1b[A\x1b[A")
    prompt.expect("MR 51200")


def test_a_refused_line_holds_those_that_were_typed_ahead(shop, prompt):
    lines = [f'PR "line {number}"' for number in range(40)]
    prompt.send("\r".join(['PR "fir","st"', "QQ 5", *lines, "half a li"]))
    prompt.expect("first\r")
    prompt.expect("refused 'QQ 5'")
    prompt.expect("not sent, as 'QQ 5' failed: PR .line 39.|more lines were not sent")  # ten are shown at a time
    prompt.send("\x15/stop\r")
    prompt.expect("stop sent to every drive")
    assert "\nline 0\r" not in prompt.before
    prompt.send('PR "go","ing on"\r')
    prompt.expect("going on\r")


def test_the_rest_of_a_paste_in_which_the_stop_came_is_dropped_whenever_it_comes(shop, prompt):
    prompt.send(f"{PASTE}MR 5\rMR 6\x18")
    stopped(prompt)
    prompt.send("MR 512000\rMR 512000\r\x1b[20")
    prompt.send('1~PR "as"," new"\r')
    prompt.expect("the rest of the paste in which the stop came was dropped, too")
    prompt.expect("as new\r")
    assert shop.velocity() == 0


def test_pasted_lines_wait_for_enter_and_run_one_after_the_other(prompt):
    prompt.send(f'{PASTE}PR "fir","st"\nPR "sec","ond"\n\x1b[201~')
    prompt.expect("PR .sec.,.ond.")
    prompt.send("\r")
    prompt.expect("first\r")
    prompt.expect("second\r")


def test_ctrl_r_finds_an_earlier_line(prompt):
    prompt.send('PR "find ","me"\rPR "not ","me"\r')
    prompt.expect("not me\r")
    prompt.expect("b>")  # the library reads the history with the first painting of a prompt
    prompt.send("\x12find")
    prompt.expect('reverse-i-search.*"me"')
    prompt.send("\r\r")
    prompt.expect("find me\r")


def test_the_prompt_names_bus_and_drive_where_several_are_open_and_a_bus_that_is_not(shop):
    child = shop.terminal("shell", "press", "noisy")
    child.expect("press:b>")
    child.send("/use noisy\r")
    child.expect("noisy:a>")
    child.send("@gone:a MR 5\r")
    child.expect("no bus gone")
    child.expect("press, noisy")
    child.send("\x18")
    child.expect("stop sent to every drive")
    child.send("/close noisy\r")
    child.expect("noisy is closed")
    child.send("@noisy:a MR 5\r")
    child.expect("no bus noisy")


def test_the_stop_key_works_while_a_silent_server_is_opened(shop, silent):
    child = shop.terminal("shell", f"tcp://127.0.0.1:{silent.port}?timeout=600")
    child.expect("opening tcp")
    silent.wait_for(b"VR")
    child.send("MR 51200\r/quit\r\x18")
    child.expect("not sent, as a stop came: MR 51200")
    assert read_to_end(child) == 4
    written = silent.written()
    assert b"\x1b" in written and b"MR 51200" not in written


def test_what_is_open_already_is_stopped_and_seen_to_stand_while_another_line_is_opened(shop, silent):
    child = shop.terminal("shell", "press")
    child.expect("b>")
    child.send("SL 50000\r")
    until(lambda: shop.velocity() == 50000, "the drive does not move")
    other = shop.terminal("shell", "press", f"tcp://127.0.0.1:{silent.port}?timeout=600")
    silent.wait_for(b"VR")
    other.expect("b>")
    other.send("\x18")
    other.expect("press: b: stopped, velocity 0")
    assert read_to_end(other) == 4
    assert shop.velocity() == 0


def test_the_stop_key_works_while_send_opens_a_silent_server(shop, silent):
    child = shop.terminal("send", f"tcp://127.0.0.1:{silent.port}?timeout=600", "MR 51200")
    silent.wait_for(b"VR")
    child.send("\x18")
    assert read_to_end(child) == 4
    assert b"\x1b" in silent.written() and b"MR" not in silent.written()


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_while_a_silent_server_is_opened_is_130(shop, silent, number):
    child = shop.terminal("shell", f"tcp://127.0.0.1:{silent.port}?timeout=600")
    silent.wait_for(b"VR")
    child.kill(number)
    assert ends(child) == 130


def test_what_is_typed_while_it_opens_is_a_line_of_the_prompt(shop):
    child = shop.terminal("shell", "press")
    child.expect("opening press")
    child.send('PR "typed"," ahead"\r')
    child.expect("typed ahead\r")


def test_a_terminal_that_hangs_up_ends_the_prompt_with_130_and_stops_what_runs(shop):
    shop.macro("go", "SL 50000", "/sleep 1000")
    for how in ("EIO", "SIGHUP"):
        child = shop.terminal("shell", "press")
        child.expect("b>")
        child.send("/play go\r")
        until(lambda: shop.velocity() == 50000, "the drive does not move")
        child.ptyproc.fileobj.close() if how == "EIO" else child.kill(signal.SIGHUP)
        _, status = os.waitpid(child.pid, 0)
        shop.terminals.remove(child)
        child.closed = True
        assert os.waitstatus_to_exitcode(status) == 130
        assert shop.velocity() == 0


def test_keys_of_the_same_read_answer_no_question_and_a_later_one_does(shop, prompt):
    line = "@* SL 50000"
    prompt.send(f"{line}\ry\rPR P")
    prompt.expect(r"can start every drive of the line. Go on\? \[y/N\]")
    prompt.expect("not sent, as a question came: PR P")
    assert shop.velocity() == 0
    prompt.send("n")
    prompt.expect("the answer was no")
    prompt.expect(r"not sent, as '@\* SL 50000' failed: y")
    assert shop.velocity() == 0
    prompt.send(f"{line}\r")
    prompt.expect(r"Go on\?")
    time.sleep(2 * TYPING_PAUSE)  # the pause itself: from here on a key counts
    prompt.send("y")
    until(lambda: shop.velocity() == 50000, "the answer does not count")
    prompt.send("\x18")
    stopped(prompt)
    assert shop.velocity() == 0
