"""A device that is no drive: it is silent, says the same again and again, or gives back what it is sent."""

from __future__ import annotations

import asyncio
from typing import Any

from multidrop.transports import Transport


class Talker(Transport):
    """The pipe to such a device."""

    name, gathers = "port", False

    def __init__(self, says: bytes = b"", every: float = 0.0, repeats: bool = False, network: bool = False) -> None:
        self.says, self.every, self.repeats, self.network = says, every, repeats, network
        self._task: Any = None

    def start(self, received: Any, lost: Any) -> None:
        self._received = received

        async def talk() -> None:
            while True:
                await asyncio.sleep(self.every)
                received(self.says)

        if self.every:
            self._task = asyncio.ensure_future(talk())

    def write(self, data: bytes) -> bool:
        if self.repeats:
            asyncio.get_running_loop().call_soon(self._received, data)
        return True

    def preempt(self, whole: bool, make: Any) -> bool:
        return True

    def discard(self, whole: bool = False) -> int:
        return 0

    async def close(self) -> None:
        if self._task is not None:
            self._task.cancel()
