"""Ending with drives in motion: a terminal asks once and names them, a pipe does not."""

import asyncio
import re
import signal

import pytest

from multidrop.base.errors import Stopped
from multidrop.drives.drive import confirmed_motion
from tests.support.cell_session import CellSession, bus, party, pmx
from tests.support.front_door import read_to_end
from tests.support.processes import Running
from tests.support.served_cell import until

pytestmark = [pytest.mark.virtual, pytest.mark.process]


async def test_what_moves_is_found_by_a_quick_look_and_what_does_not_answer_is_not_known(tmp_path):
    floor = (bus("press", party("a"), party("b"), party("c")), bus("line", party("d")), bus("stages", pmx("00")))
    async with CellSession(tmp_path, *floor) as shop:
        assert await shop.session.in_motion() == []
        for line in ("@press:a SL 5000", "@line:d SL 400", "@stages:00 JX+"):
            await shop.session.run(line)
        shop.world("/sim power c off")
        await asyncio.sleep(2.0)
        shop.world("/sim unplug line")
        await asyncio.sleep(3.0)
        begun = shop.session.now()
        found = await shop.session.in_motion()
        assert shop.session.now() - begun <= 2.0
        assert found[0] == "press:a moves at 5000 a second"
        assert found[1] == "press:c is not known: last seen standing 7 s ago"
        assert found[2] == "line:d is not known: started 6 s ago and not read since"
        assert found[3].startswith("stages:00 moves at ") and len(found) == 4


async def test_a_fresh_reading_is_not_asked_for_again(tmp_path):
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        await confirmed_motion(shop.session.selected)
        shop.events.clear()
        assert await shop.session.in_motion() == []
        assert shop.written("press") == b""
        await shop.session.run("SL 5000")
        await asyncio.sleep(0.5)
        assert await shop.session.in_motion() == ["a moves at 5000 a second"], "what was sent since makes it old"


async def test_what_a_stop_ends_is_waited_for_and_no_reason_to_ask(tmp_path):
    async def macro():
        try:
            await asyncio.sleep(100)
        finally:
            await asyncio.sleep(1.5)  # its drives are read, for the report of its end

    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        playing = asyncio.create_task(shop.session.tasks.run(macro()))
        await asyncio.sleep(0.1)
        shop.session.stop("Ctrl+X")
        await asyncio.sleep(0.1)
        assert shop.session.busy
        assert await shop.session.in_motion() == [] and not shop.session.busy
        with pytest.raises(Stopped):
            await playing


@pytest.mark.pty
@pytest.mark.parametrize("end", ["/quit\r", "\x04"])
def test_the_prompt_asks_once_while_a_drive_moves(shop, end):
    child = shop.terminal("shell", "press")
    child.expect("b>")
    child.send("SL 5000\r")
    child.expect("b>")
    child.send(end)
    child.expect(r"b moves at \d+ a second")  # it may still accelerate
    child.expect("/quit again leaves them moving")
    child.send("PR 6*1\r")
    child.expect("b>")
    child.send(end)
    child.expect("/quit again leaves them moving")
    child.send(end)
    assert read_to_end(child) == 0 and shop.velocity() == 5000


@pytest.mark.pty
@pytest.mark.parametrize(("early", "keys"), [(False, "/quit\r"), (False, "\x04"), (True, "PR V\r\x04")])
def test_the_prompt_ends_at_once_where_nothing_moves(shop, keys, early):
    child = shop.terminal("shell", "press")
    if not early:  # else some of it before the process holds the terminal
        child.expect("b>")
    child.send(keys)
    assert read_to_end(child) == 0


def test_a_pipe_is_not_asked(shop):
    piped = Running("shell", "press", folder=shop.folder)
    piped.say("SL 5000", "/quit")
    assert piped.end() == 0 and piped.errors == [] and shop.velocity() == 5000


@pytest.mark.parametrize("lines", [("/quit", "SL 5000"), ("/exit", "", "  ", "SL 5000")])
def test_lines_that_follow_a_quit_are_named_in_a_pipe_and_by_send(shop, lines):
    piped = Running("shell", "press", folder=shop.folder)
    piped.process.stdin.write("".join(f"{line}\n" for line in lines))
    assert piped.end() == 0 and piped.errors == ["not sent, as it follows a /quit: SL 5000"]
    sent = Running("send", "press", *lines, folder=shop.folder)
    assert sent.end() == 0 and sent.errors == ["not sent, as it follows a /quit: SL 5000"]
    assert shop.velocity() == 0


@pytest.mark.pty
@pytest.mark.parametrize("end", ["/quit\r", "\x04", "exit\r", "\x1b[200~/quit\nSL 5000\x1b[201~\r"])
def test_what_is_typed_after_the_end_of_a_prompt_is_not_sent_and_named(shop, end):
    child = shop.terminal("shell", "press")
    child.expect("b>")
    child.send(f"{end}SL 5000\r")
    assert read_to_end(child) == 0 and shop.velocity() == 0
    assert re.search(r"not sent, as .*: SL 5000", child.before)


@pytest.mark.pty
@pytest.mark.parametrize("end", ["/quit\r", "\x04"])
def test_a_second_quit_that_was_typed_before_the_question_ends_no_prompt(shop, end):
    child = shop.terminal("shell", "press")
    child.expect("b>")
    child.send("SL 5000\r")
    child.expect("b>")
    child.send(f"{end}{end}SL 9\r")
    child.expect("/quit again leaves them moving")
    child.expect("not sent, as it was typed after a quit: SL 9")
    child.send("PR 6*1\r")
    child.expect("b>")
    assert child.isalive() and shop.velocity() == 5000


@pytest.mark.pty
def test_the_screen_names_what_it_dropped_on_the_terminal(shop):
    child = shop.terminal("tui", "press")
    child.expect("polls")
    child.send("\x11SL 5000\r")
    assert read_to_end(child) == 0 and shop.velocity() == 0
    assert "not sent, as multidrop is ending: SL 5000" in child.before.rpartition("\x1b[?1049l")[2]


@pytest.mark.pty
@pytest.mark.parametrize("front", ["tui", "shell"])
def test_the_stop_key_works_until_the_process_ends(shop, front):
    macros = shop.folder / "conf" / "macros"
    macros.mkdir(exist_ok=True)
    steps = '[[step]]\nline = \'PR "at wo","rk"\'\n[[step]]\nline = "/sleep 1000"\n'
    (macros / "go.toml").write_text(f'name = "go"\non_early_end = ["/sleep 9"]\n{steps}')
    child = shop.terminal(front, "press")
    child.expect("b>" if front == "shell" else "polls")
    child.send("SL 5000\r")
    until(lambda: shop.velocity() == 5000, "it does not move")
    child.send("/play go\r")
    child.expect("at work")
    child.kill(signal.SIGTERM)
    child.expect("waiting 10 s at most")  # the screen is gone, the process is not
    child.send("MR 7\r\x18")
    until(lambda: shop.velocity() == 0, "the key did not stop it")
    child.send("SL 77\r")
    assert read_to_end(child) == 130 and shop.velocity() == 0
    assert "stop: " in child.before and "SL 77" in child.before


@pytest.mark.pty
@pytest.mark.parametrize("front", ["tui", "shell"])
@pytest.mark.parametrize("mine", [True, False], ids=["a macro's", "an operator's"])
def test_a_signal_stops_what_a_macro_started_and_not_what_an_operator_did(shop, front, mine):
    macros = shop.folder / "conf" / "macros"
    macros.mkdir(exist_ok=True)
    line = "SL 5000" if mine else "PR P"
    (macros / "go.toml").write_text(f'name = "go"\n[[step]]\nline = "{line}"\n[[step]]\nline = "/sleep 1000"\n')
    child = shop.terminal(front, "press")
    child.expect("b>" if front == "shell" else "polls")
    for typed in ("SL 5000" if not mine else "PR P", "/play go"):
        child.send(f"{typed}\r")
    until(lambda: shop.velocity() == 5000, "it does not move")
    child.kill(signal.SIGTERM)
    assert read_to_end(child) == 130
    assert shop.velocity() == (0 if mine else 5000)
    assert ("stopped b: velocity 0 was read from b" in child.before) is mine


DWELLS = 'program_text = """\nPG 1\nLB G1\nH 60000\nBR G1\nE\nPG\n"""'


async def test_a_program_that_dwells_is_a_reason_to_ask_and_one_that_was_stopped_is_not(tmp_path):
    async with CellSession(tmp_path, bus("press", f"{party('a')}\n{DWELLS}", party("b"))) as shop:
        await shop.session.run("@a EX G1")
        await asyncio.sleep(5.0)
        assert await shop.session.in_motion() == ["a runs a program, which may move it"]
        shop.session.stop()
        await asyncio.sleep(2.0)
        assert await shop.session.in_motion() == []
