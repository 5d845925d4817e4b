"""The question at the prompt: one key answers, but no key that was typed before the question could be read."""

import asyncio
import contextlib

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

from multidrop.dialects import Diagnostic, Stopped
from multidrop.shell.connect.settings import Settings
from multidrop.shell.events import Entered, Notified
from multidrop.shell.prompt.prompt import Prompt
from multidrop.shell.prompt.terminal_input import PAUSE
from multidrop.shell.session import Session
from tests.support.virtual import in_virtual_time

LONG = PAUSE * 2


@contextlib.asynccontextmanager
async def asked(folder):
    """A prompt that asks; the session's task of asking; the keys."""
    session = Session(Settings(folder=folder / "config", state=folder / "state"))
    session.told = []
    session.subscribe(lambda event: session.told.append(event) if isinstance(event, Entered | Notified) else None)
    with create_pipe_input() as keys, create_app_session(input=keys, output=DummyOutput()):
        prompt = Prompt(session)
        run = asyncio.create_task(prompt.run())
        while not prompt._prompt.app.is_running:
            await asyncio.sleep(0.01)
        question = asyncio.create_task(session.questions.confirm("CP erases the program", "a"))
        await asyncio.sleep(0.01)
        assert prompt._message() == "a: CP erases the program. Go on? [y/N] "
        try:
            yield keys.send_text, question, prompt
        finally:
            run.cancel()
            await asyncio.gather(run, question, return_exceptions=True)
            await session.close()


def entered(prompt):
    return [event.line for event in prompt._session.told if isinstance(event, Entered)]


def noticed(prompt):
    return [event.text for event in prompt._session.told if isinstance(event, Notified)]


@in_virtual_time
async def test_one_key_answers(tmp_path):
    async with asked(tmp_path) as (send, question, prompt):
        await asyncio.sleep(LONG)
        send("y")
        await question
        assert prompt._message() == "> "
        send("/help MR\r")
        await asyncio.sleep(LONG)
        assert entered(prompt) == ["/help MR"]


@in_virtual_time
async def test_enter_escape_and_ctrl_c_are_no(tmp_path):
    for key in ("n", "\r", "\x1b", "\x03", "\x04"):
        async with asked(tmp_path) as (send, question, prompt):
            await asyncio.sleep(LONG)
            send(key)
            with pytest.raises(Diagnostic, match="the answer was no"):
                await question
            assert not prompt._session.latched and entered(prompt) == []


@in_virtual_time
async def test_what_was_typed_ahead_answers_nothing(tmp_path):
    async with asked(tmp_path) as (send, question, prompt):
        send("/sleep 0\rY100")
        await asyncio.sleep(LONG)
        assert entered(prompt) == ["/sleep 0"]
        assert noticed(prompt) == ["not sent, as a question came: Y100"]
        send("MR 1y\r")  # no answer: y and Enter come right after other keys
        await asyncio.sleep(LONG)
        assert not question.done() and prompt._prompt.default_buffer.text == ""
        send("y")
        await question


@in_virtual_time
async def test_keys_that_edit_a_line_do_nothing_while_a_question_is_open(tmp_path):
    async with asked(tmp_path) as (send, question, prompt):
        await asyncio.sleep(LONG)
        send("\x1b[A\x12\t\x17\x1b[200~MR 5\rMR 6\x1b[201~")
        await asyncio.sleep(LONG)
        assert not question.done() and not prompt._prompt.app.layout.is_searching
        assert prompt._prompt.default_buffer.text == "" and entered(prompt) == []


@in_virtual_time
async def test_the_stop_key_goes_first_and_is_no_yes(tmp_path):
    async with asked(tmp_path) as (send, question, prompt):
        await asyncio.sleep(LONG)
        send("\x18")
        with pytest.raises(Stopped):
            await question
        assert prompt._session.latched and prompt._message() == "> "
        send("/help MR\r")
        await asyncio.sleep(LONG)
        assert entered(prompt) == ["/help MR"]
