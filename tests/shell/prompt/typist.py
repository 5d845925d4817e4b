"""The prompt driven through prompt_toolkit's own pipe, without a terminal: keys in, what is shown and told out."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from prompt_toolkit.application import Application, AppSession, create_app_session
from prompt_toolkit.data_structures import Size
from prompt_toolkit.input import PipeInput, create_pipe_input
from prompt_toolkit.output import DummyOutput
from prompt_toolkit.output import Output as Terminal

from multidrop.shell.configuration import Settings
from multidrop.shell.events import Entered, Notified, Output
from multidrop.shell.prompt.prompt import Prompt
from multidrop.shell.session import Session
from tests.support.posix import left_out
from tests.support.until import until

COLUMNS = 200


class Wide(DummyOutput):
    """A terminal on which no toolbar is cut."""

    def get_size(self) -> Size:
        return Size(rows=40, columns=COLUMNS)


class Typist:
    """A prompt over a session without buses, and the keys to type on. Made by `typist`."""

    def __init__(self, session: Session, keys: PipeInput, terminal: AppSession) -> None:
        self.session, self.keys, self._terminal = session, keys, terminal
        self.events: list[Any] = []
        session.subscribe(self.events.append)
        self.code = asyncio.create_task(Prompt(session).run())

    def send(self, text: str) -> None:
        """Type."""
        self.keys.send_text(text)

    @property
    def app(self) -> Application[Any]:
        """The application that takes the keys."""
        app = self._terminal.app
        assert app is not None, "the prompt has not begun"
        return app

    @property
    def running(self) -> bool:
        return self._terminal.app is not None and self._terminal.app.is_running

    @property
    def screen(self) -> str:
        """The prompt, what is typed, and the toolbar, as they were drawn last."""
        drawn = self.app.renderer.last_rendered_screen
        if drawn is None:
            return ""
        rows = [drawn.data_buffer[y] for y in range(drawn.height)]
        return "\n".join("".join(row[x].char for x in range(max(row, default=-1) + 1)).rstrip() for row in rows)

    async def shows(self, text: str) -> None:
        """Wait until the prompt begins with this text."""
        await until(lambda: self.screen.startswith(text))

    @property
    def entered(self) -> list[str]:
        return [event.line for event in self.events if isinstance(event, Entered)]

    @property
    def notices(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Notified)]

    @property
    def output(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Output)]

    async def ends(self) -> int:
        """Wait until the prompt ends; return its exit code."""
        await until(self.code.done)
        return self.code.result()


@contextlib.asynccontextmanager
async def typist(folder: Path, output: Terminal | None = None) -> AsyncIterator[Typist]:
    """Run a prompt whose settings and state are in this folder. `output`: its terminal; a wide one by default."""
    if sys.platform == "win32":  # prompt_toolkit waits for keys in a thread there, for which virtual time does not wait
        left_out("fork")
    session = Session(Settings(folder=folder / "config", state=folder / "state", data=folder / "data"))
    with create_pipe_input() as keys, create_app_session(input=keys, output=output or Wide()) as terminal:
        made = Typist(session, keys, terminal)
        try:
            await until(lambda: made.running)
            yield made
        finally:
            made.code.cancel()
            await asyncio.gather(made.code, return_exceptions=True)
            await session.close()
