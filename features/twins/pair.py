"""Drives and their twins, of one bus: what a drive takes reaches its twin, and each sample is compared with it.

Theory of operation. A twin is a simulated drive in the time of a real one: the bytes that the real one took go in,
positions come out. It has no clock and no timer. It lives up to the time of each sample, and of what its drive took. No
sample of a drive comes in the middle of a conversation with it. So a conversation reaches the twin as a whole, once it
is over. Bytes without a request are a stop, or a person's own: they reach every twin at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import copysign, inf

from multidrop.dialects import End, Priority
from multidrop.dialects.family import Motion
from multidrop.dialects.values import Snapshot
from multidrop.drives.bus import Bus
from multidrop.drives.conversations import ASKING
from multidrop.drives.drive import Drive
from multidrop.drives.events import (
    BusEvent,
    Changed,
    Concluded,
    Conditioned,
    Lost,
    Sample,
    Sent,
    Traffic,
    Transaction,
    Valued,
)
from multidrop.drives.port_journal import GLOBAL
from multidrop.drives.telemetry import DriveValue, Subscription
from multidrop.features.twins.twin import LIMITS, Twin
from multidrop.shell.comparing.compared import Compared
from multidrop.shell.comparing.differences import (
    FADING,
    HOMING,
    PUSHED,
    UNSEEN,
    AxisComparison,
    Pair,
    unmoved,
)
from multidrop.shell.events import Agreed, Diverged, TwinEnded, TwinEvent

# The requests of a conversation that the drive has taken: only these reach its twin.
#
# A request counts once the whole conversation is over, at the time at which its last byte had left. In a conversation
# that succeeded, every request counts but those that the drive refused as damaged, which were repeated. In one that
# failed, the last command counts only if the drive acknowledged it. Otherwise its execution is doubtful.


NOT_TAKEN = (End.REFUSED, End.NAK, End.STOPPED)


def reading_took(concluded: Concluded) -> float | None:
    """The time between the first and the last request of a reading of motion, s; None for another conversation."""
    result = concluded.outcome.result[0] if concluded.outcome.result else None
    first = result[0] if isinstance(result, tuple) and result else None
    if not isinstance(first, Motion) or not concluded.transactions:
        return None
    return concluded.transactions[-1].transmitted_at - concluded.transactions[0].transmitted_at


def taken(concluded: Concluded) -> Iterator[Transaction]:
    """Yield the transactions of which the drive has taken the request; no polls."""
    commands = [transaction for transaction in concluded.transactions if transaction.request.kind not in ASKING]
    failed_with = commands[-1] if concluded.outcome.error is not None and commands else None
    for transaction in concluded.transactions:
        doubtful = transaction is failed_with and not transaction.reply.acknowledged
        polled = transaction.request.priority is Priority.POLL
        if transaction.sent and transaction.reply.end not in NOT_TAKEN and not doubtful and not polled:
            yield transaction


DRIFT = 0.005
"""The part of the time by which a program may run faster or slower than in the twin."""
LONGEST_DRIFT_TIME = 30.0
"""Seconds without a steady move whose drift is made good at once, at most."""


class TwinPair(Compared[Twin]):
    """One drive with its twin. Times are those of the host's clock."""

    def __init__(self, drive: Drive, twin: Twin, begun: float) -> None:
        super().__init__(twin)
        self.drive, self.begun = drive, begun
        self._read_at = begun
        """When the inputs were last read."""
        self._in_step_at = begun
        self._stopped: dict[str, int] = {}
        """The velocities at a stop, until a reply shows how late it may have been."""
        self._quickest = inf
        """The shortest time from a reading's request to its reply, s."""
        self._delay = 0.0
        """Seconds by which the last replies came later than that: a request or a stop may take as much on its way."""

    def sample(self, sample: Sample, rest: int) -> Iterator[TwinEvent]:
        """Compare a sample with the twin, keep that in step, and let it take a position that it could not follow."""
        name, at, axis = sample.axis, sample.at, self.comparison(sample.axis)
        if name not in self.twin.motion(at):  # a motor that the simulated module does not have
            return
        awaited = self.twin.awaits(name, at)
        if awaited is not None and not axis.lost:
            axis.lose(HOMING, at)
        if sample.velocity:
            self._limits.pop(name, None)
            axis.lag = max(axis.lag, self._delay)
        for news in super().sample(sample, rest):
            yield news
            if isinstance(news, Diverged) and unmoved(axis.pairs):
                axis.lose(UNSEEN if any(each.velocity for each in axis.pairs) else PUSHED, at)
        pair = axis.pairs[-1]
        if abs(pair.difference) > axis.limit(pair, rest):
            self._meet(name, axis, pair, awaited)
        if axis.over(awaited is not None):
            yield from self._take_position(sample, axis, rest, awaited)
        else:
            self._keep_step(axis)

    def _meet(self, name: str, axis: AxisComparison, pair: Pair, awaited: str | None) -> None:
        """Learn of a difference where a switch is: one that homing awaits, or a limit that is seen to be active."""
        if axis.lost:
            axis.learned = self.twin.meet(name, awaited or "", pair.at) or axis.learned
        elif not pair.velocity and (limits := self._limits.get(name)):
            for limit in limits:
                self.twin.meet(name, LIMITS[limit], pair.at)
            self.twin.align(name, pair.position, pair.at)
            axis.lose(f"a limit ({', '.join(limits)})", pair.at)
            axis.learned = True
        elif pair.velocity and not pair.expected and self.twin.at_learned(name, pair.at):
            self.twin.forget(name)
            axis.lose("a limit that is not where it was", pair.at)

    def _take_position(
        self, sample: Sample, axis: AxisComparison, rest: int, awaited: str | None
    ) -> Iterator[TwinEvent]:
        """Take the position of a drive at rest; say so unless the twin was there."""
        pair, why = axis.pairs[-1], axis.lost
        beyond = abs(pair.difference) > axis.limit(pair, rest)
        if why == HOMING and (awaited is not None or beyond):
            self.twin.forget(sample.axis)  # what it has learned is not so
        if axis.apart or axis.learned or beyond or awaited is not None:
            self.doubtful = ""
            self._causes.pop(sample.axis, None)
            yield Agreed(sample.at, sample.address, sample.axis, why)
        if not pair.velocity and (pair.difference or awaited is not None):
            self.twin.align(sample.axis, sample.position, sample.at)
        axis.begin_again()

    @property
    def asks(self) -> bool:
        """Whether the lamps of the drive would tell why it stands."""
        return any(axis.held for axis in self.axes.values() if axis.pairs)

    def _keep_step(self, comparison: AxisComparison) -> None:
        """Shift the twin's time a little where a drive is early or late at an equal velocity.

        The lines of its program take another time than the simulator's. No shift changes where the two rest.
        """
        if not comparison.steady:
            return
        before, pair = list(comparison.pairs)[-2:]
        most = DRIFT * min(pair.at - self._in_step_at, LONGEST_DRIFT_TIME)
        late = pair.difference / copysign(pair.fastest, pair.predicted - before.predicted)
        late = copysign(max(0.0, abs(late) - comparison.took), late)  # what the reading took is not the drive's
        self.twin.shift(max(-most, min(most, late)))
        self._in_step_at = pair.at

    # What reaches the twin

    def concluded(self, concluded: Concluded) -> None:
        """Take a conversation that is over."""
        if (took := reading_took(concluded)) is not None:
            last = concluded.transactions[-1]
            self._quickest = min(self._quickest, last.ended_at - last.transmitted_at)
            self._note_delay(last)
            self._took = took + self._delay
        for request in taken(concluded):
            data = request.request.codec.encode(request.request)
            disturbs = request.request.kind not in ASKING
            if disturbs and request.reply.acknowledged:
                self._note_delay(request)
            self._acts(data, request.transmitted_at, disturbs)
            referencing = self.drive.family.referencing(request.request.text) if disturbs else None
            if referencing is not None and referencing.homing:
                self.comparison(referencing.axis).lose(HOMING, request.transmitted_at)
        if concluded.unproven:
            self.doubtful = concluded.unproven

    def _note_delay(self, transaction: Transaction) -> None:
        """Note how late a reply came. A delay that was seen fades with further replies."""
        delay = transaction.ended_at - transaction.transmitted_at - self._quickest
        for axis, velocity in self._stopped.items():  # the stop was as late as this request, at most
            self.comparison(axis).disturbed(velocity, max(0.0, delay - self._delay))
        self._stopped = {}
        self._delay = max(0.0, delay, FADING * self._delay)

    def stopped(self, data: bytes, at: float) -> None:
        """Take the bytes of a stop, or those that a person typed in raw mode."""
        self._stopped = self.velocities(at)
        self._acts(data, at)

    def inputs(self, value: int, at: float) -> None:
        """Take the inputs as they were read; they may have changed at any time since the reading before."""
        before = self.velocities(at)
        if self.twin.put(value, at):
            for axis, velocity in before.items():
                self.comparison(axis).disturbed(velocity, at - self._read_at)
        self._read_at = at

    def _acts(self, data: bytes, at: float, disturbs: bool = True) -> None:
        if disturbs:
            self.disturbed(at, self._delay)
        self.twin.hear(data, at)


SAMPLE_PERIOD = 0.1
"""Seconds between two samples of a drive, at most."""
INPUTS = 0.05
"""Seconds between two readings of the inputs of a drive, at most."""


class BusTwins:
    """The twins of the drives of a bus."""

    def __init__(self, bus: Bus, limit: int, publish: Callable[[TwinEvent], None], lost: Callable[[], None]) -> None:
        """`limit`: that at rest, steps. `lost`: called when the line is lost."""
        self.bus = bus
        self._limit = limit
        self.besides: dict[Drive, TwinPair] = {}
        self._waiting: dict[Drive, list[Concluded]] = {}
        """The conversations of a drive that is being read."""
        self._publish, self._lost = publish, lost
        self._departing = False
        """The bytes of a request are written next."""
        self._ends: list[Callable[[], None]] = [bus.watch(self._take), bus.witnesses.add(self._concluded)]
        self._polled: list[str] = []
        """The addresses that are read."""
        self._samples: Subscription[str] | None = None
        self._inputs: Subscription[DriveValue] | None = None
        self._asked: dict[str, Subscription[str]] = {}
        """The drives whose lamps are read once, by address."""

    def set_limit(self, steps: int) -> None:
        self._limit = steps

    # Drives

    @property
    def drives(self) -> list[Drive]:
        """The drives that have a twin, or are about to."""
        return list(dict.fromkeys((*self.besides, *self._waiting)))

    def expect(self, drive: Drive) -> None:
        """Keep what a drive takes after its snapshot, until its twin is there."""
        self._waiting[drive] = []

    def begin(self, beside: TwinPair) -> None:
        """Begin to run a twin, with what its drive took meanwhile."""
        self.remove(beside.drive)
        self.besides[beside.drive] = beside
        for concluded in self._waiting.pop(beside.drive, ()):
            beside.concluded(concluded)
        self._poll()

    def forgo(self, drive: Drive) -> None:
        """Expect no twin of a drive any more."""
        self._waiting.pop(drive, None)

    def remove(self, drive: Drive) -> None:
        if (beside := self.besides.pop(drive, None)) is not None:
            self._publish(TwinEnded(self.bus.now(), beside.drive.address))

    def close(self) -> None:
        for drive in list(self.besides):
            self.remove(drive)
        self._poll()
        while self._ends:
            self._ends.pop()()

    def _poll(self) -> None:
        telemetry, before = self.bus.telemetry, (self._samples, self._inputs)
        addresses = self._polled = [beside.address for beside in self.besides]
        words = [
            DriveValue(drive.address, beside.twin.levels.word)
            for drive, beside in self.besides.items()
            if beside.twin.levels is not None
        ]
        self._samples = telemetry.subscribe(addresses, SAMPLE_PERIOD) if addresses else None
        self._inputs = telemetry.read(words, INPUTS) if words else None
        for subscription in (*before, *self._asked.values()):
            if subscription is not None:
                subscription.close()
        self._asked = {}

    # Events

    def _take(self, event: BusEvent) -> None:
        if isinstance(event, Sample):
            if (beside := self._at(event.address)) is not None:
                for news in beside.sample(event, self._limit):
                    self._publish(news)
                if beside.asks and event.address not in self._asked:
                    self._asked[event.address] = self.bus.telemetry.watch([event.address])
                for data in beside.twin.printed():  # the other twins overhear what one has printed for them
                    for other in self.besides.values():
                        if other is not beside:
                            other.twin.overhear(data, event.at)
        elif isinstance(event, Sent):
            self._departing = True
        elif isinstance(event, Traffic):
            if event.outgoing and not self._departing:
                for beside in self.besides.values():
                    beside.stopped(event.data, event.at)
            self._departing = self._departing and not event.outgoing
        elif isinstance(event, Valued):
            beside = self._at(event.address)
            if beside is not None and beside.twin.levels is not None and event.word == beside.twin.levels.word:
                beside.inputs(int(event.value), event.at)
        elif isinstance(event, Conditioned):
            if (beside := self._at(event.address)) is not None:
                beside.conditions(event.conditions)
                if (asked := self._asked.pop(event.address, None)) is not None:
                    asked.close()
        elif isinstance(event, Changed) and self._polled != [each.address for each in self.besides]:  # DN, PY
            self._poll()
        elif isinstance(event, Lost):
            self._lost()

    def _at(self, address: str) -> TwinPair | None:
        drive = self.bus.drives.get(address)
        return self.besides.get(drive) if drive is not None else None

    def _concluded(self, concluded: Concluded) -> None:
        for drive, waiting in self._waiting.items():
            if drive.state is concluded.state or concluded.state.address in GLOBAL:
                if concluded.outcome.result and isinstance(concluded.outcome.result[0], Snapshot):
                    waiting.clear()
                else:
                    waiting.append(concluded)
        for drive, beside in self.besides.items():
            if drive.state is concluded.state or concluded.state.address in GLOBAL:
                beside.concluded(concluded)
