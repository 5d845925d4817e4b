"""The messages that wait for the broker: so many of them, the oldest dropped first and counted."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from typing import NamedTuple

MOST = 10_000
"""Messages that wait at most; some 5 MB."""


class Message(NamedTuple):
    """A message for the broker. `bus`: the line that it is about; empty: none."""

    topic: str
    text: str
    retain: bool = False
    bus: str = ""


class Backlog:
    """A bounded queue that also keeps the last message of each retained topic."""

    def __init__(self, most: int = MOST) -> None:
        self._waiting: deque[Message] = deque()
        self._most = most
        self._retained: dict[str, Message] = {}
        self._dropped: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, message: Message) -> None:
        """Add a message; a full queue drops its oldest one."""
        if message.retain:
            self._retained[message.topic] = message
        self._waiting.append(message)
        self._bound()

    def first(self) -> Message | None:
        """The oldest message; it stays until `sent`."""
        return self._waiting[0] if self._waiting else None

    def sent(self) -> None:
        """Remove the oldest message."""
        self._waiting.popleft()

    def give_back(self, messages: Sequence[Message]) -> None:
        """Put messages before all others."""
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
        """The number of messages that were dropped since `take_dropped`."""
        return self._dropped.total()

    def take_dropped(self) -> Counter[str]:
        """Return the numbers of messages that were dropped, by bus, and count from 0."""
        found, self._dropped = self._dropped, Counter()
        return found

    def _bound(self) -> None:
        while len(self._waiting) > self._most:
            self._dropped[self._waiting.popleft().bus] += 1
