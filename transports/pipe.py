"""The common half of all pipes: deliver bytes, break once, close once.

A pipe is open, then broken or closed. A read or a caller's `write` may break it. The pipe calls `lost` in a later turn
of the event loop, so no caller is re-entered from its own call. It first delivers what arrived before the break.
Closing lingers over bytes that were written and have not left yet, because the last of them may be a stop. A stuck pipe
delays closing by no more than that.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeVar

from multidrop.transports.base import Lost, PortControl, Received, TransportLost

LINGER = 1.0
"""Seconds that closing waits for bytes that were written and have not left: 960 bytes at 9600 baud."""
_LOOK = 0.005

T = TypeVar("T")


class Pipe(ABC):
    """The common half of a transport. Created and used in the loop's thread."""

    def __init__(self, name: str, control: PortControl | None = None) -> None:
        self._name = name
        self.control = control
        self._loop = asyncio.get_running_loop()
        self._received: Received | None = None
        self._lost: Lost | None = None
        self._broken: TransportLost | None = None
        self._told = False
        self._closing: asyncio.Task[None] | None = None
        self._released: asyncio.Future[None] | None = None

    @property
    def name(self) -> str:
        """The name for a person."""
        return self._name

    def start(self, received: Received, lost: Lost) -> None:
        """Begin to deliver bytes. A pipe that is already broken reports it now."""
        if self._received is not None:
            raise RuntimeError(f"{self._name} was started before")
        self._received, self._lost = received, lost
        if self._broken is not None:
            self._loop.call_soon(self._tell)
        elif self._usable:
            self._begin()

    async def close(self) -> None:
        """Close the pipe. Every caller waits until it is closed; cancelling one of them stops nothing."""
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
        """Mark the pipe as broken by `error`, or (None) as closed by the other end. May be called repeatedly."""
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
        """Release the system's resources once, in a thread, because closing a serial port may block."""
        if self._released is None:
            self._released = self._loop.run_in_executor(None, self._release)
        return self._released

    @abstractmethod
    def _begin(self) -> None:
        """Start reading."""

    @abstractmethod
    def _halt(self) -> None:
        """Stop reading and writing, and drop what is queued. May be called repeatedly."""

    @abstractmethod
    def _drain(self) -> None:
        """Deliver what arrived before the break."""

    @abstractmethod
    def _idle(self) -> bool:
        """True if all that was written has left."""

    @abstractmethod
    def _release(self) -> None:
        """Close the descriptor or device; called once, from another thread."""

    @abstractmethod
    def _explain(self, error: OSError | None) -> str:
        """Reason of a break, and the remedy; None: the other end closed the pipe."""


async def in_thread(make: Callable[[], T], undo: Callable[[T], None]) -> T:
    """Call `make` in a thread and return its result; if the caller is cancelled meanwhile, `undo` the result."""

    def forget(late: asyncio.Future[T]) -> None:
        if not late.cancelled() and late.exception() is None:
            undo(late.result())

    made = asyncio.get_running_loop().run_in_executor(None, make)
    try:
        return await asyncio.shield(made)
    except asyncio.CancelledError:
        made.add_done_callback(forget)
        raise
