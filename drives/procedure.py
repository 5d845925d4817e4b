"""A conversation of many requests under way: what is asked next, until there is a result.

A conversation (`Procedure`) is a generator that a dialect writes; a procedure steps it with replies or errors. An error
thrown into it (a stop, a lost pipe) may be answered with more requests, with which it cleans up; so it is over only
when `request` is None.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from dialects import Procedure, Reply, Request

T = TypeVar("T")


class ProcedureRunner(Generic[T]):
    """Steps a conversation. `request` is what it asks now, None when it is over."""

    def __init__(self, talk: Procedure[T]) -> None:
        self._talk = talk
        self._result: list[T] = []
        self.request: Request | None = None
        self._step(lambda: next(talk))

    def _step(self, advance: Callable[[], Request]) -> None:
        self.request = None
        try:
            self.request = advance()
        except StopIteration as done:
            self._result = [done.value]

    def answer(self, reply: Reply) -> None:
        """Hand it the reply to its request."""
        self._step(lambda: self._talk.send(reply))

    def fail(self, error: Exception) -> None:
        """Throw an error into it. What it raises goes to the caller, unless it asks something more."""
        self._step(lambda: self._talk.throw(error))

    @property
    def result(self) -> T:
        """What the conversation returned."""
        return self._result[0]
