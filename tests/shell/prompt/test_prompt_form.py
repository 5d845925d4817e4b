"""A form at the prompt and at a terminal: each value is asked for until it is valid."""

from __future__ import annotations

import asyncio
import contextlib
import io
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

from multidrop.dialects import Diagnostic, Stopped
from multidrop.macros import Macro, Step
from multidrop.shell.connect.settings import Settings
from multidrop.shell.events import Entered, Notified
from multidrop.shell.macro_arguments import value_fields
from multidrop.shell.prompt.prompt import Prompt
from multidrop.shell.prompt.terminal_input import PAUSE, at_terminal
from multidrop.shell.session import Session
from tests.support.virtual import in_virtual_time

LONG = PAUSE * 2
FIELDS = value_fields(Macro("m", (Step(0.0, "{turns:int=10,1..100} {mode:choice(a|b)}"),)), {})


@contextlib.asynccontextmanager
async def asked(folder: Path) -> AsyncIterator[tuple[Callable[[str], None], asyncio.Future[Any], Prompt, list[str]]]:
    """A prompt that asks; the keys, the answers, and what was told."""
    session = Session(Settings(folder=folder / "config", state=folder / "state"))
    told: list[str] = []
    session.subscribe(lambda event: told.append(event.text) if isinstance(event, Notified) else None)
    session.subscribe(lambda event: told.append(event.line) if isinstance(event, Entered) else None)
    with create_pipe_input() as keys, create_app_session(input=keys, output=DummyOutput()):
        prompt = Prompt(session)
        run = asyncio.create_task(prompt.run())
        while not prompt._prompt.app.is_running:
            await asyncio.sleep(0.01)
        answers = asyncio.create_task(session.tasks.run(session.questions.fill_in("macro m", FIELDS)))
        await asyncio.sleep(0.01)
        try:
            yield keys.send_text, answers, prompt, told
        finally:
            run.cancel()
            await asyncio.gather(run, answers, return_exceptions=True)
            await session.close()


@in_virtual_time
async def test_each_value_is_asked_for_until_it_is_valid(tmp_path: Path) -> None:
    async with asked(tmp_path) as (send, answers, prompt, told):
        assert prompt._message() == "macro m: turns, a whole number, 1 to 100 [10]: "
        for text in ("500\r", "\r"):
            await asyncio.sleep(LONG)
            send(text)
        await asyncio.sleep(LONG)
        assert told == ["macro m: invalid turns = '500'; valid: a whole number, 1 to 100"]
        assert prompt._message() == "macro m: mode, a or b: "
        for text in ("\r", "b\r"):
            await asyncio.sleep(LONG)
            send(text)
        assert await answers == {"turns": "10", "mode": "b"}
        assert told[1:] == ["a value is needed; Ctrl+C gives up"]
        assert prompt._message() == "> " and list(prompt._prompt.history.get_strings()) == []


@in_virtual_time
async def test_ctrl_c_escape_and_ctrl_d_give_up(tmp_path: Path) -> None:
    for key in ("\x03", "\x1b", "\x04"):
        async with asked(tmp_path) as (send, answers, prompt, told):
            await asyncio.sleep(LONG)
            send("5")
            send(key)
            with pytest.raises(Diagnostic, match="macro m: no values were given; nothing was sent"):
                await answers
            assert not prompt._session.latched and prompt._prompt.app.is_running


@in_virtual_time
async def test_what_was_typed_ahead_is_a_line_and_no_answer(tmp_path: Path) -> None:
    async with asked(tmp_path) as (send, answers, prompt, told):
        send("/sleep 0\r77")
        await asyncio.sleep(LONG)
        assert told == ["/sleep 0", "not sent, as a question came: 77"] and not answers.done()


@in_virtual_time
async def test_a_stop_ends_the_form(tmp_path: Path) -> None:
    async with asked(tmp_path) as (send, answers, prompt, told):
        await asyncio.sleep(LONG)
        send("\x18")
        with pytest.raises(Stopped):
            await answers
        assert prompt._session.latched and prompt._message() == "> "


@pytest.mark.parametrize(
    ("typed", "answers"),
    [("\nx\nb\n", {"turns": "10", "mode": "b"}), ("7\n", None), ("", None)],
)
def test_a_terminal_is_asked_line_by_line(
    typed: str, answers: dict[str, str] | None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(typed))
    assert at_terminal("macro m", FIELDS) == answers
    assert "macro m: turns, a whole number, 1 to 100 [10]: " in capsys.readouterr().err
