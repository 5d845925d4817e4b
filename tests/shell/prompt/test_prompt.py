"""The prompt driven through prompt_toolkit's own pipe, without a terminal."""

import asyncio

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

from multidrop.shell.connect.settings import Settings
from multidrop.shell.events import Entered, Output, Progressed, StateChanged
from multidrop.shell.prompt.prompt import Prompt
from multidrop.shell.session import Session
from tests.support.until import PATIENCE


class Typist:
    """A prompt over a session, and the keys to type on."""

    def __init__(self, keys, session):
        self.keys, self.session = keys, session
        self.entered, self.output = [], []
        self.noticed = asyncio.Event()
        session.subscribe(self.take)
        self.prompt = Prompt(session)
        self.code = asyncio.create_task(self.prompt.run())

    def take(self, event):
        if isinstance(event, Entered):
            self.entered.append(event.line)
        if isinstance(event, Output):
            self.output.append(event.text)
        if isinstance(event, Entered | StateChanged):
            self.noticed.set()

    async def until(self, condition):
        async with asyncio.timeout(PATIENCE):
            while not condition():
                self.noticed.clear()
                await self.noticed.wait()

    async def ends(self):
        async with asyncio.timeout(PATIENCE):
            return await self.code


@pytest.fixture
async def typist(tmp_path):
    session = Session(Settings(folder=tmp_path / "config", state=tmp_path / "state"))
    with create_pipe_input() as keys, create_app_session(input=keys, output=DummyOutput()):
        made = Typist(keys, session)
        yield made
        made.code.cancel()
        await asyncio.gather(made.code, return_exceptions=True)
        await session.close()


async def test_lines_run_in_order_and_are_kept_in_the_history(typist, tmp_path):
    typist.keys.send_text("/sleep 0\r/help MR\r/drives\r")
    await typist.until(lambda: "/drives" in typist.entered)
    assert typist.entered == ["/sleep 0", "/help MR", "/drives"]
    assert any("MR" in line for line in typist.output)
    typist.keys.send_text("/quit\r")
    assert await typist.ends() == 0
    assert (tmp_path / "state" / "history").read_text().splitlines() == ["/sleep 0", "/help MR", "/drives", "/quit"]


async def test_the_stop_key_stops_at_once_and_drops_what_waits(typist):
    typist.keys.send_text("/sleep 1000\r/sleep 2000\r")
    await typist.until(lambda: typist.entered == ["/sleep 1000"])
    typist.keys.send_text("half a line\x18")
    await typist.until(lambda: typist.session.latched)
    await typist.until(lambda: not typist.session.busy)
    typist.keys.send_text("\x03/quit\r")
    assert await typist.ends() == 0
    assert "/sleep 2000" not in typist.entered


async def test_the_toolbar_shows_the_progress_of_a_job(typist):
    await typist.until(lambda: typist.prompt._prompt.app.is_running)
    typist.session.publish(Progressed(0.0, "a: download", 3, 10, 2.0))
    assert "a: download: 3 of 10, 2 s left" in typist.prompt._toolbar()
    typist.session.publish(Progressed(0.0, "a: download", 10, 10, 0.0))
    assert "download" not in typist.prompt._toolbar()


async def test_the_toolbar_shows_that_a_log_is_on(typist, tmp_path):
    await typist.until(lambda: typist.prompt._prompt.app.is_running)
    await typist.session.run(f"/log {tmp_path / 'day.jsonl'}")
    assert "  log day.jsonl  " in typist.prompt._toolbar()
    await typist.session.run("/log off")
    assert "log day" not in typist.prompt._toolbar()


async def test_the_toolbar_says_what_is_known_since_a_stop(typist):
    await typist.until(lambda: typist.prompt._prompt.app.is_running)
    assert typist.prompt._toolbar().startswith("^X STOP ALL  /open")
    typist.session.stop()
    assert typist.prompt._toolbar().startswith(
        "^X STOP ALL  · NO STOP SENT   no drive is open       /resume lets macros run"
    )


async def test_ctrl_c_clears_the_line_or_stops_what_runs(typist):
    typist.keys.send_text("MR 51200\x03/sleep 1000\r")
    await typist.until(lambda: typist.entered == ["/sleep 1000"])
    typist.keys.send_text("\x03")
    await typist.until(lambda: typist.session.latched)


async def test_ctrl_d_ends_and_stops_what_still_ran(typist):
    typist.keys.send_text("/sleep 1000\r")
    await typist.until(lambda: typist.session.busy)
    typist.keys.send_text("\x04")
    assert await typist.ends() == 0
    await typist.until(lambda: not typist.session.busy)
    assert not typist.session.latched


async def test_ctrl_r_finds_a_line_of_an_earlier_run(tmp_path):
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "history").write_text("/help VM\n/help MR\n/sleep 0\n")
    session = Session(Settings(folder=tmp_path / "config", state=tmp_path / "state"))
    with create_pipe_input() as keys, create_app_session(input=keys, output=DummyOutput()):
        typist = Typist(keys, session)
        keys.send_text("\x12help V\r\r")
        await typist.until(lambda: typist.entered)
        keys.send_text("\x04")
        await typist.ends()
        assert typist.entered == ["/help VM"]
    await session.close()
