"""Step a conversation of many requests without a line: the next request, until there is a result.

A conversation (`Procedure`) is a generator that a dialect writes; a `ProcedureRunner` steps it with replies or errors.
The conversation may answer an error (a stop, a lost port) with more requests, which clean up. So it is over only when
`request` is None.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from multidrop.dialects import Procedure, Reply, Request

T = TypeVar("T")


class ProcedureRunner(Generic[T]):
    """Steps a conversation. `request` is the one it sends now, None when it is over."""

    def __init__(self, procedure: Procedure[T]) -> None:
        self._procedure = procedure
        self._result: list[T] = []
        self.request: Request | None = None
        self._step(lambda: next(procedure))

    def _step(self, advance: Callable[[], Request]) -> None:
        self.request = None
        try:
            self.request = advance()
        except StopIteration as done:
            self._result = [done.value]

    def answer(self, reply: Reply) -> None:
        """Hand it the reply to its request."""
        self._step(lambda: self._procedure.send(reply))

    def fail(self, error: Exception) -> None:
        """Throw an error into it. What it raises goes to the caller, unless it sends another request."""
        self._step(lambda: self._procedure.throw(error))

    @property
    def result(self) -> T:
        """The value that the conversation returned."""
        return self._result[0]
