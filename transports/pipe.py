"""What all pipes have in common: delivering, breaking once, closing once.

A pipe is open, then broken or closed. Whatever breaks it, a read or a caller's `write`, `lost` is told in a turn of
the event loop of its own, so that no caller is entered again from inside its own call; what had come before the
break is delivered first. Closing lingers for a moment over bytes that were written but have not left yet, because
the last of them may be a stop; a stuck pipe does not hold it up for longer than that.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeVar

from transports.base import Lost, Received, TransportLost

LINGER = 1.0
"""Seconds that closing gives to bytes that were written but have not left: 960 bytes at 9600 baud."""
_LOOK = 0.005

T = TypeVar("T")


class Pipe(ABC):
    """The half of a transport that is the same for every kind of pipe. Made and used in the loop's thread."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._loop = asyncio.get_running_loop()
        self._received: Received | None = None
        self._lost: Lost | None = None
        self._broken: TransportLost | None = None
        self._told = False
        self._closing: asyncio.Task[None] | None = None
        self._released: asyncio.Future[None] | None = None

    @property
    def name(self) -> str:
        """What a person calls it."""
        return self._name

    def start(self, received: Received, lost: Lost) -> None:
        """Begin to deliver bytes. A pipe that broke before says so now."""
        if self._received is not None:
            raise RuntimeError(f"{self._name} was started before")
        self._received, self._lost = received, lost
        if self._broken is not None:
            self._loop.call_soon(self._tell)
        elif self._usable:
            self._begin()

    async def close(self) -> None:
        """Close it. All who close it wait until it is closed; cancelling one of them stops nothing."""
        if self._closing is None:
            self._closing = self._loop.create_task(self._shut())
        await asyncio.shield(self._closing)

    @property
    def _usable(self) -> bool:
        return self._broken is None and self._closing is None

    def _deliver(self, data: bytes) -> None:
        if self._received is not None and self._closing is None and not self._told:
            self._received(data)

    def _break(self, error: OSError | None) -> None:
        """The pipe broke with `error`, or (None) came to its end. May be called more than once."""
        self._halt()
        if self._broken is None:
            self._broken = TransportLost(f"{self._name} was lost: {self._explain(error)}")
            self._loop.call_soon(self._tell)

    def _tell(self) -> None:
        if self._lost is None or self._broken is None:
            return
        self._drain()
        if self._told or self._closing is not None:
            return
        self._told = True
        self._let_go()
        self._lost(self._broken)

    async def _shut(self) -> None:
        try:
            deadline = self._loop.time() + LINGER
            while self._broken is None and not self._idle() and self._loop.time() < deadline:
                await asyncio.sleep(_LOOK)
        finally:
            self._halt()
            await asyncio.shield(self._let_go())

    def _let_go(self) -> asyncio.Future[None]:
        """Release what the system lent us, once; in a thread, as closing a serial port can take its time."""
        if self._released is None:
            self._released = self._loop.run_in_executor(None, self._release)
        return self._released

    @abstractmethod
    def _begin(self) -> None:
        """Start to read."""

    @abstractmethod
    def _halt(self) -> None:
        """Stop to read and to write, drop what is queued. May be called more than once."""

    @abstractmethod
    def _drain(self) -> None:
        """Deliver what had come before the pipe broke."""

    @abstractmethod
    def _idle(self) -> bool:
        """Whether all that was written has left."""

    @abstractmethod
    def _release(self) -> None:
        """Close the descriptor or device; called once, from another thread."""

    @abstractmethod
    def _explain(self, error: OSError | None) -> str:
        """Why it broke and what to do about it; None: it came to its end."""


async def in_thread(make: Callable[[], T], undo: Callable[[T], None]) -> T:
    """What `make` returns, made in a thread; should the caller be cancelled meanwhile, it is undone again."""

    def forget(late: asyncio.Future[T]) -> None:
        if not late.cancelled() and late.exception() is None:
            undo(late.result())

    made = asyncio.get_running_loop().run_in_executor(None, make)
    try:
        return await asyncio.shield(made)
    except asyncio.CancelledError:
        made.add_done_callback(forget)
        raise
