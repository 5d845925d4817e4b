"""A stream of what happens, taken as it comes: telemetry and events."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any, Generic, TypeVar

from multidrop.drives.telemetry import Subscription
from multidrop.shell.events import SessionEvent
from multidrop.shell.session import Session

T = TypeVar("T")
Self = TypeVar("Self", bound="AsyncStream[Any]")


class AsyncStream(ABC, Generic[T]):
    """An asynchronous iterator until `close`, the end of the session, or a loss. Reads drives only while it is open."""

    def __init__(self, shell: Session, subscriptions: Sequence[Subscription[str]]) -> None:
        self._shell, self._subscriptions = shell, subscriptions
        self._rows: deque[T] = deque()
        self._news = asyncio.Event()
        self._lost: Exception | None = None
        self._open = True
        self._leave = shell.subscribe(self._take)

    @abstractmethod
    def _take(self, event: SessionEvent) -> None: ...

    def _add(self, row: T) -> None:
        self._rows.append(row)
        self._news.set()

    def _end(self, error: Exception) -> None:
        """Raise this once what came before is taken."""
        self._lost = error
        self._news.set()

    def close(self) -> None:
        """End it. What came before can still be taken. May be called again."""
        if self._open:
            self._open = False
            self._leave()
            for subscription in self._subscriptions:
                subscription.close()
            self._news.set()

    async def __aenter__(self: Self) -> Self:
        """Return it; the end of the block closes it."""
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def __aiter__(self: Self) -> Self:
        return self

    async def __anext__(self) -> T:
        """Wait for the next one. Raises what ends it once all before are taken."""
        while not self._rows:
            if self._lost is not None:
                raise self._lost
            if not self._open:
                raise StopAsyncIteration
            self._news.clear()
            await self._news.wait()
        return self._rows.popleft()
