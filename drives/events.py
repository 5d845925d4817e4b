"""Events of a bus, on their way to its watchers: frozen facts with the time at which they happened.

Times are those of the event loop's clock, s. Events are named tuples, which take a third of the time of a frozen
dataclass to make: each request makes four. A watcher, or a witness of a conversation's end, that fails affects neither
the others nor the caller (`isolated`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from multidrop.base.errors import TransportLost
from multidrop.base.isolation import at_once, isolated
from multidrop.dialects import DriveState, End, Reply, Request
from multidrop.dialects.values import Conditions


class Transaction(NamedTuple):
    """A request and its reply, with both times and how it ended (`reply.end`)."""

    request: Request
    reply: Reply
    sent_at: float
    ended_at: float
    transmitted_at: float
    """When the last byte of the request had left, calculated from the baud rate."""
    sent: bool = True
    """Whether the request was written; one that was stopped before that was not."""

    @property
    def replied(self) -> bool:
        """Whether its drive has replied to it, a refusal included."""
        return self.reply.end in (End.DONE, End.REFUSED, End.NAK) and not self.reply.doubtful


class Sent(NamedTuple):
    """A request went onto the wire."""

    at: float
    request: Request


class Ended(NamedTuple):
    """A transaction ended, successfully or not."""

    at: float
    transaction: Transaction


class Unsolicited(NamedTuple):
    """Lines that answer no request: prints of a running program, a name at the end of a move, a sign-on.

    What was received at once is one event, since a program may print a thousand lines at a time.
    """

    at: float
    lines: tuple[str, ...]
    greeting: bool = False
    """They may be a gateway's greeting: the connection is new, and no drive has replied yet."""


class Rested(NamedTuple):
    """What confirms that one drive came to rest after a stop."""

    stop: int
    """The number of the stop on its line."""
    drives: int
    """How many drives it was for."""
    name: str
    places: tuple[tuple[str, int], ...]
    """Axis and position, counts; the only axis of a drive has no name."""


class Notice(NamedTuple):
    """A message for the user: a drive was taken out of program mode, a stop was seen to work."""

    at: float
    text: str
    address: str = ""
    warning: bool = False
    rested: Rested | None = None


class Traffic(NamedTuple):
    """Raw bytes, `outgoing` or incoming. `stop`: they are those of a stop."""

    at: float
    outgoing: bool
    data: bytes
    stop: bool = False


class Sample(NamedTuple):
    """Position (steps, or counts with EE=1) and velocity (per second) of one axis of one drive."""

    at: float
    address: str
    position: int
    velocity: int
    axis: str = ""
    trouble: str = ""
    """The fault that this reading reports, in words; empty if it reports none."""
    program: bool | None = None
    """Whether a program runs in the drive; None: not read with it."""


class Conditioned(NamedTuple):
    """The conditions of every axis of a drive."""

    at: float
    address: str
    conditions: tuple[Conditions, ...]


class Valued(NamedTuple):
    """A value that was read, by its word."""

    at: float
    address: str
    word: str
    value: float


class Silent(NamedTuple):
    """A polled drive did not answer."""

    at: float
    address: str


class Lost(NamedTuple):
    """The port is lost; all requests are refused until its drives are found again."""

    at: float
    error: TransportLost


class Restarted(NamedTuple):
    """A drive was restarted: what was known of its program and its settings is not what it holds."""

    at: float
    address: str
    certain: bool = True
    """False: it may have been, and nothing that is read of it would show that."""


class Changed(NamedTuple):
    """A drive or the bus changed state: opened, lost, in or out of program mode, renamed."""

    at: float
    address: str = ""


BusEvent = (
    Sent | Ended | Unsolicited | Notice | Traffic | Sample | Valued | Conditioned | Silent | Lost | Restarted | Changed
)


E = TypeVar("E")
Watcher = Callable[[BusEvent], None]


class Subscribers(dict[type, tuple[Callable[[E], None], ...]]):
    """The callbacks for each kind of event, in the order of subscription; found at the first event of a kind."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.isolated = isolated(name)
        self._all: tuple[tuple[Callable[[E], None], tuple[type, ...]], ...] = ()
        """The subscriptions: a callback and the kinds that it takes, none for all."""

    def __missing__(self, kind: type) -> tuple[Callable[[E], None], ...]:
        callbacks = self[kind] = tuple(callback for callback, kinds in self._all if not kinds or kind in kinds)
        return callbacks

    def add(self, callback: Callable[[E], None], kinds: tuple[type, ...]) -> Callable[[], None]:
        added = (callback, kinds)
        self._all = (*self._all, added)
        self.clear()

        def leave() -> None:
            self._all = tuple(each for each in self._all if each is not added)
            self.clear()

        return leave

    def call(self, kind: type, event: E) -> None:
        """Pass an event to those that take its kind."""
        callbacks, over = iter(self[kind]), False
        while not over:  # after a subscriber that fails, the next one
            with self.isolated:
                for callback in callbacks:
                    callback(event)
                over = True


class Publisher(Generic[E]):
    """Passes events to its subscribers, in the order of subscription. `name` is theirs in the log of defects.

    A subscriber that fails affects neither the others nor the caller. `kind`: returns the kind of an event.
    """

    def __init__(self, name: str, kind: Callable[[E], type] = type) -> None:
        self._kind = kind
        self.subscribers = Subscribers[E](name)

    def subscribe(self, callback: Callable[[E], None], *kinds: type) -> Callable[[], None]:
        """Call back with every event of these kinds, by default of all, from the event loop.

        The function returned ends the subscription. Raises Diagnostic for an async callback.
        """
        at_once(callback)
        return self.subscribers.add(callback, kinds)

    def publish(self, event: E) -> None:
        self.subscribers.call(self._kind(event), event)


class EventQueue(Publisher[BusEvent]):
    """Publishes events of a bus in their order, also those that a subscriber causes."""

    def __init__(self, name: str) -> None:
        super().__init__(f"a watcher of {name}")
        self.held = False
        """`publish` only collects events; the one who holds them calls `tell`."""
        self._events: deque[BusEvent] = deque()
        self._telling = False

    def collect(self, event: BusEvent) -> None:
        """Add an event; `tell` publishes it."""
        self._events.append(event)

    def publish(self, event: BusEvent) -> None:
        """Publish an event, after those before it."""
        self._events.append(event)
        if not self.held:
            self.tell()

    def tell(self) -> None:
        """Publish what was collected; called by a watcher, it leaves that to the call under way."""
        if self._telling or not self._events:
            return
        callbacks: Iterator[Watcher] = iter(())
        self._telling, event = True, self._events[0]
        try:
            while self._telling:
                with self.subscribers.isolated:
                    for callback in callbacks:  # after a watcher that fails, the next one
                        callback(event)
                    while self._events:
                        event = self._events.popleft()
                        callbacks = iter(self.subscribers[type(event)])
                        for callback in callbacks:
                            callback(event)
                    self._telling = False
        finally:
            self._telling = False


T = TypeVar("T")


@dataclass(frozen=True)
class ConversationOutcome(Generic[T]):
    """The end of a conversation: its result, or the error that it raised; its first and its last transaction."""

    result: tuple[T, ...] = ()
    error: BaseException | None = None
    first: Transaction | None = None
    last: Transaction | None = None

    def value(self) -> T:
        if self.error is not None:
            raise self.error
        return self.result[0]


@dataclass(frozen=True)
class Concluded:
    """A conversation that is over: its transactions in order, and how it ended."""

    state: DriveState
    transactions: tuple[Transaction, ...]
    outcome: ConversationOutcome[Any]
    unproven: str
    """The command with which it failed, if it is not known whether that was executed."""


Witness = Callable[[Concluded], None]


class Witnesses:
    """The functions called at the end of every conversation of a link, before its caller goes on."""

    def __init__(self, name: str) -> None:
        self.all: tuple[Witness, ...] = ()
        self._isolated = isolated(f"a witness of {name}")

    def add(self, witness: Witness) -> Callable[[], None]:
        """Add one; the function returned removes it."""
        self.all = (*self.all, witness)

        def leave() -> None:
            self.all = tuple(each for each in self.all if each is not witness)

        return leave

    def report(self, concluded: Concluded) -> None:
        for witness in self.all:
            with self._isolated:
                witness(concluded)
