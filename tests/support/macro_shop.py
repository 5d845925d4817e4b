"""A cell in a session that plays macros, with the results of what was played last; one line of a macro."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from multidrop.macros import Macro, MacroStep
from multidrop.shell.configuration import Settings
from multidrop.shell.events import By, Entered
from multidrop.shell.origin import PERSON
from multidrop.shell.scripts.executor import play
from multidrop.shell.scripts.model import LineResult, MacroEnding
from multidrop.shell.session import Session
from tests.support.cell_session import CellSession, bus, party

FLOOR = (bus("press", party("a"), party("b", VM=700000), baud=0), bus("gantry", party("c"), baud=0))


class Shop(CellSession):
    """A cell with macros, and the results of what was played last."""

    def __init__(self, folder: Path, reconnect: bool = False) -> None:
        super().__init__(folder, *FLOOR, reconnect=reconnect)
        self.results: list[LineResult] = []
        self.endings: list[MacroEnding] = []

    def save(self, name: str, *lines: str, after: float = 0.0, **more: object) -> Macro:
        macro = Macro(name, tuple(MacroStep(after, line) for line in lines), **more)  # type: ignore[arg-type]
        self.session.macros.save(macro)
        return macro

    async def play(self, macro: Macro, values: dict[str, str] | None = None, **manner: object) -> None:
        await play(self.session, PERSON, macro, values or {}, executed=self.executed, ended=self.ended, **manner)  # type: ignore[arg-type]

    def executed(self, result: LineResult) -> None:
        self.results.append(result)

    def ended(self, ending: MacroEnding) -> None:
        self.endings.append(ending)

    def begun(self) -> list[tuple[float, str]]:
        """When each line began."""
        return [(round(event.at, 1), event.line) for event in self.events if isinstance(event, Entered)]


def macro_runner(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Coroutine[Any, Any, None]]:
    """Work in the folder `here`, in which `out` leads out of it; return a function that runs a line, as of a macro."""
    (folder / "here").mkdir()
    (folder / "here" / "out").symlink_to(folder)
    monkeypatch.chdir(folder / "here")

    async def run(line: str, by: By = By.MACRO) -> None:
        session = Session(Settings(folder=folder, state=folder))
        try:
            await session.open("sim:#press")
            await session.run(line, replace(session.origin, by=by))
        finally:
            await session.close()

    return run
