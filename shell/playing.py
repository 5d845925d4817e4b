"""A macro that plays: how far it is, and which bus plays each of its roles."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Protocol

FOREVER = "forever"
"""The word for rounds without an end."""
NO_ROLES: Mapping[str, str] = MappingProxyType({})
"""No bus plays a role."""
_roles: ContextVar[Mapping[str, str]] = ContextVar("roles", default=NO_ROLES)


class Progress(Protocol):
    """Shows how far a macro is."""

    def begins(self, step: int, line: str) -> None:
        """Take the beginning of a step."""

    def show(self) -> None:
        """Show it now."""


@dataclass(eq=False)
class Playing:
    """A macro under way. `times` None: it plays until it is stopped. Steps and rounds count from 1."""

    name: str
    steps: int
    times: int | None = 1
    key: str = ""
    rounds: int = 0
    """The rounds that are done."""
    step: int = 0
    """The step under way; 0 before the first one."""
    progress: Progress | None = None
    task: asyncio.Task[object] | None = field(default_factory=asyncio.current_task)
    ended: bool = False
    """Its end was asked for (`/play stop`)."""

    def end(self) -> None:
        """End it as a failure would."""
        self.ended = True
        if self.task is not None:
            self.task.cancel()

    @property
    def round(self) -> int:
        """The round under way."""
        return self.rounds + 1

    @property
    def short(self) -> str:
        """The progress for a narrow place: `F3 2/5`."""
        return f"{self.key or self.name} {self.step}/{self.steps}"

    @property
    def at(self) -> str:
        """The place in the macro: `step 2 of 5, round 2 of 3`."""
        step = f"step {self.step} of {self.steps}" if self.step else "its beginning"
        return f"{step}{self._round}"

    @property
    def _round(self) -> str:
        if self.times == 1:
            return ""
        return f", round {self.round}" + (f" of {self.times}" if self.times else "")


@contextlib.contextmanager
def cast(roles: Mapping[str, str]) -> Iterator[None]:
    """Let buses play roles while the body runs, and in the tasks that it starts."""
    token = _roles.set({**_roles.get(), **roles})
    try:
        yield
    finally:
        _roles.reset(token)


def played_by(name: str) -> str:
    """The name of the bus that plays a role; any other name stays."""
    return _roles.get().get(name, name)
