"""The way of messages to a broker that may be away: a bounded backlog, and attempts to connect with back-off.

Theory of operation. `put` adds a message to the backlog, and the pump sends as many as the connection takes. After a
loss the messages that were not acknowledged go back to the front of the backlog. Once the broker is back, the state of
this program is the first message, and every retained message follows those that waited.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter, deque
from collections.abc import Callable, Sequence

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.base.text import counted
from multidrop.features.publishing.broker import BrokerConnection, BrokerMessage
from multidrop.shell.connect import Pauses

MOST_QUEUED_MESSAGES = 10_000
"""Messages that wait at most; some 5 MB."""


class Backlog:
    """A bounded queue that also keeps the last message of each retained topic."""

    def __init__(self, most: int = MOST_QUEUED_MESSAGES) -> None:
        self._waiting: deque[BrokerMessage] = deque()
        self._most = most
        self._retained: dict[str, BrokerMessage] = {}
        self._dropped: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, message: BrokerMessage) -> None:
        if message.retain:
            self._retained[message.topic] = message
        self._waiting.append(message)
        self._bound()

    def first(self) -> BrokerMessage | None:
        return self._waiting[0] if self._waiting else None

    def sent(self) -> None:
        self._waiting.popleft()

    def give_back(self, messages: Sequence[BrokerMessage]) -> None:
        self._waiting.extendleft(reversed(messages))
        self._bound()

    def renew(self) -> None:
        """Add every retained message again, for a broker that may have lost them or has older ones."""
        waiting = {each.topic: each for each in self._waiting}
        for topic, message in list(self._retained.items()):
            if waiting.get(topic) is not message:  # else it is the last of its topic already
                self.put(message)

    @property
    def dropped(self) -> int:
        return self._dropped.total()

    def take_dropped(self) -> Counter[str]:
        """Return the numbers of messages that were dropped, by bus, and count from 0."""
        dropped, self._dropped = self._dropped, Counter()
        return dropped

    def _bound(self) -> None:
        while len(self._waiting) > self._most:
            self._dropped[self._waiting.popleft().bus] += 1


FIRST_PAUSE, LONGEST_PAUSE = 1.0, 30.0
"""The pause before the first attempt to connect again, s; each further one is twice as long, up to the longest."""
DRAIN = 2.0
"""The longest time for the last messages at the end, s."""
LOOK_PERIOD = 0.02
REMIND = 60.0
"""The time between two reports of what is dropped while it goes on, s."""


async def connected(make: Callable[[], BrokerConnection]) -> BrokerConnection:
    """Make a connection, and connect. Raises TransportLost or Diagnostic."""
    connection = make()
    await connection.connect()
    return connection


async def again(make: Callable[[], BrokerConnection], notify: Callable[[str], None]) -> BrokerConnection:
    """Try until there is a connection; say each reason once."""
    pauses, said = Pauses(FIRST_PAUSE, LONGEST_PAUSE), ""
    while True:
        await asyncio.sleep(pauses.now)
        pauses.lengthen()
        try:
            return await connected(make)
        except (TransportLost, Diagnostic) as failure:
            if str(failure) != said:
                said = str(failure)
                notify(f"the broker is still lost: {said}")


async def over(task: asyncio.Task[None]) -> None:
    """Cancel a task, and wait for its end. `wait_for` of Python 3.11 swallows a cancellation that meets its result."""
    while not task.done():
        task.cancel()
        await asyncio.wait([task], timeout=1)


class MessagePublisher:
    """Messages on their way to a broker. `begin` connects, `end` says goodbye."""

    def __init__(
        self,
        make: Callable[[], BrokerConnection],
        online: BrokerMessage,
        notify: Callable[[str], None],
        dropped: Callable[[Counter[str]], None],
        backlog: Backlog | None = None,
    ) -> None:
        """Make a publisher that is not connected yet. `online`: the message that opens each connection.

        `notify` takes warnings for a person. `dropped` takes the numbers of messages that were dropped, by bus.
        """
        self._make, self._online, self._notify, self._dropped = make, online, notify, dropped
        self._backlog = Backlog() if backlog is None else backlog
        self._connection: BrokerConnection | None = None
        """None while the broker is away."""
        self._task: asyncio.Task[None] | None = None
        self._said_dropped = float("-inf")
        self.sent = 0
        """The number of messages that a connection took."""
        self.lost = 0
        """The number of messages that were dropped."""

    async def begin(self) -> None:
        """Connect for the first time. Raises TransportLost or Diagnostic."""
        connection = await connected(self._make)
        self._begun(connection)
        self._task = asyncio.get_running_loop().create_task(self._keep(connection))

    def put(self, message: BrokerMessage) -> None:
        self._backlog.put(message)
        self.pump()

    def pump(self) -> None:
        connection = self._connection
        while connection is not None and (message := self._backlog.first()) is not None:
            if not connection.publish(message):
                return
            self._backlog.sent()
            self.sent += 1
        if connection is not None and self._backlog.dropped:
            self._say_dropped()
            self._backlog.renew()  # a retained message may be among those
            self.pump()

    def look(self) -> None:
        """Send what the connection takes; now and then, report what is being dropped. Call it every second."""
        self.pump()
        now = asyncio.get_running_loop().time()
        if self._backlog.dropped and now > self._said_dropped + REMIND:
            self._say_dropped()

    def _say_dropped(self) -> None:
        self._said_dropped = asyncio.get_running_loop().time()
        dropped = self._backlog.take_dropped()
        self.lost += dropped.total()
        lost = counted(dropped.total(), "message for the broker was", "messages for the broker were")
        self._notify(f"{lost} dropped, the oldest of those that waited")
        self._dropped(dropped)

    async def end(self, goodbye: BrokerMessage) -> None:
        """Send what waits, and the goodbye, within a limit; then disconnect."""
        self._backlog.put(goodbye)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(DRAIN):
                while self._connection is not None and (len(self._backlog) or self._connection.in_flight()):
                    self.pump()
                    await asyncio.sleep(LOOK_PERIOD)
        if self._task is not None:
            await over(self._task)
        if self._connection is not None:
            await self._connection.close()
        self._give_back()

    @property
    def connected(self) -> bool:
        return self._connection is not None

    @property
    def waiting(self) -> int:
        return len(self._backlog)

    def _begun(self, connection: BrokerConnection) -> None:
        connection.on_room = self.pump
        self.sent += connection.publish(self._online)
        self._backlog.renew()
        self._connection = connection
        self.pump()

    def _give_back(self) -> None:
        """Take messages that were not acknowledged from a connection that has ended."""
        connection, self._connection = self._connection, None
        if connection is not None:
            unsent = connection.in_flight()
            self.sent -= len(unsent)
            self._backlog.give_back(unsent)

    async def _keep(self, connection: BrokerConnection) -> None:
        """Connect again after each loss, until cancelled."""
        while True:
            await connection.lost.wait()
            begin = asyncio.get_running_loop().time()
            self._give_back()
            self._notify("the broker is lost; messages wait for it, and it is tried again")
            await connection.close()
            connection = await again(self._make, self._notify)
            self._notify(f"the broker is back after {asyncio.get_running_loop().time() - begin:.1f} s")
            self._begun(connection)
