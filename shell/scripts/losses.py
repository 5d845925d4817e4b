"""A connection that is lost while no line uses it: that ends a script or macro too, and not only its next line."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Collection

from drives.events import Lost
from shell.events import OnBus, SessionEvent
from shell.scripts.execution import Execution
from transports import TransportLost

GRACE = 0.2
"""The time in which a line under way fails by itself, and then says more, s."""


@contextlib.asynccontextmanager
async def ended_by_loss(execution: Execution, buses: Collection[str]) -> AsyncIterator[None]:
    """End the body, in its task, when one of these buses is lost, or one that its lines went to.

    Raises TransportLost with the place of the line under way.
    """
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    losses: list[TransportLost] = []
    timers: list[asyncio.TimerHandle] = []

    def take(event: SessionEvent) -> None:
        if not (isinstance(event, OnBus) and isinstance(event.event, Lost)):
            return
        if event.bus in buses or event.bus in {bus for bus, _ in execution.addressed}:
            timers.append(loop.call_later(GRACE, end, event.event.error))

    def end(loss: TransportLost) -> None:
        if task is not None and not execution.is_over and not losses:
            losses.append(loss)
            task.cancel()

    leave = execution.workspace.subscribe(take)
    try:
        yield
    except asyncio.CancelledError:
        if task is None or not losses or execution.stops != execution.workspace.stops:
            raise
        task.uncancel()
        loss = TransportLost(str(losses[0]))
        if execution.current is not None:
            loss.add_note(execution.current.where)
        raise loss from None
    finally:
        leave()
        for timer in timers:
            timer.cancel()
