"""A broker that keeps what it is sent, in the memory of the test."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

from multidrop.features.publishing.broker import BrokerMessage
from multidrop.transports import Unreachable


class KeptBroker:
    """Connections to it are made by `connection`. `refusals`: reasons of the next attempts, one each."""

    def __init__(self, window: int = 1000) -> None:
        self.received: list[BrokerMessage] = []
        self.connections: list[KeptConnection] = []
        self.refusals: list[str] = []
        self.attempts: list[float] = []
        self.window = window
        """Messages that a connection takes before `acknowledge`."""
        self.acknowledges = True

    def connection(self) -> KeptConnection:
        """A connection that is not made yet."""
        return KeptConnection(self)

    def cut(self) -> None:
        """Lose the connection; what was not acknowledged did not arrive."""
        self.connections[-1].lost.set()

    def texts(self, topic: str) -> list[str]:
        """The texts of a topic."""
        return [each.text for each in self.received if each.topic == topic]

    def values(self, topic: str) -> list[Any]:
        """The values of a topic."""
        return [json.loads(text)["value"] for text in self.texts(topic)]

    def retained(self) -> dict[str, str]:
        """The texts that a late subscriber is sent."""
        return {each.topic: each.text for each in self.received if each.retain}


class KeptConnection:
    """One connection."""

    def __init__(self, broker: KeptBroker) -> None:
        self._broker = broker
        self._sent: list[BrokerMessage] = []
        self.lost = asyncio.Event()
        self.on_room: Callable[[], None] = lambda: None
        self.closed = False

    async def connect(self) -> None:
        """Connect, unless it is refused."""
        self._broker.attempts.append(asyncio.get_running_loop().time())
        await asyncio.sleep(0)
        if self._broker.refusals:
            raise Unreachable(self._broker.refusals.pop(0))
        self._broker.connections.append(self)

    def publish(self, message: BrokerMessage) -> bool:
        """Take a message, while there is room."""
        if self.lost.is_set() or len(self._sent) >= self._broker.window:
            return False
        self._sent.append(message)
        if self._broker.acknowledges:
            self.acknowledge()
        return True

    def acknowledge(self) -> None:
        """Acknowledge everything."""
        self._broker.received += self._sent
        self._sent.clear()

    def in_flight(self) -> list[BrokerMessage]:
        """What is not acknowledged."""
        return list(self._sent)

    async def close(self) -> None:
        """End it."""
        self.closed = True
        self.lost.set()
