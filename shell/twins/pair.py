"""Drives and their twins, of one bus: what a drive takes reaches its twin, and each sample is compared with it.

Theory of operation. A twin is a simulated drive in the time of a real one: the bytes that the real one took go in,
positions come out. It has no clock and no timer. It lives up to the time of each sample, and of what its drive took. No
sample of a drive comes in the middle of a conversation with it. So a conversation reaches the twin as a whole, once it
is over. Bytes without a request are a stop, or a person's own: they reach every twin at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import copysign, inf
from typing import Generic, Protocol, TypeVar

from multidrop.dialects import End, Inexpressible, Priority
from multidrop.dialects.family import Motion
from multidrop.dialects.values import Conditions, Levels, Snapshot
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
from multidrop.drives.telemetry import Subscription, Value
from multidrop.shell.events import Agreed, Diverged, Predicted, TwinEnded, TwinEvent
from multidrop.shell.twins.comparing import Comparison, Pair, Verdict, causes
from multidrop.simulator import cells
from multidrop.simulator.cell.writer import BusText, write
from multidrop.simulator.families import FAMILIES, family_of, snapshots_of
from multidrop.simulator.family import Place, Shadow, Unit
from multidrop.simulator.wire import Transmission

NAME = "twin"


class Twin:
    """The simulated drive. `registers`: the real one is reached through its registers, by a connection of its own."""

    def __init__(self, unit: Unit, shadow: Shadow, levels: Levels | None, begun: float, registers: bool) -> None:
        self.levels = levels
        self._unit, self._shadow, self._begun = unit, shadow, begun
        self._connection = unit.connect() if registers and unit.connect is not None else None
        self._world = next(iter(unit.worlds.values()))
        self._now = 0.0
        self._inputs: dict[int, int] = {}
        self._overheard: list[Transmission] = []
        shadow.rest()

    def shift(self, seconds: float) -> None:
        """Let it be ahead by so much more from now on; its own time never goes back."""
        self._begun -= seconds

    def live(self, at: float) -> float:
        """Live up to a time of the host's clock; return the drive's own time."""
        self._now = max(self._now, at - self._begun)
        self._overheard += [each for each in self._unit.port.sent(self._now) if each.overheard]
        return self._now

    def hear(self, data: bytes, at: float) -> None:
        """Take bytes of the host; the replies go nowhere."""
        now = self.live(at)
        if self._connection is not None:
            self._connection.receive(data, now)
        else:
            self._unit.port.receive(data, now)
        self.live(at)

    def overhear(self, data: bytes, at: float) -> None:
        self._unit.port.overhear(data, self.live(at))

    def printed(self) -> list[bytes]:
        """The bytes for other drives of its line that it has sent since the last call."""
        printed, self._overheard = self._overheard, []
        return [each.data for each in printed]

    def put(self, value: int, at: float) -> bool:
        """Set the inputs as they were read; return whether one has changed."""
        if self.levels is None:
            return False
        levels = dict(self.levels.of(value))
        changed, self._inputs = levels != self._inputs and bool(self._inputs), levels
        now = self.live(at)
        for number, level in levels.items():
            if self._world.level(number, now) != level:
                self._world.set_input(number, level, now)
        self._unit.device.advance(now)
        return changed

    def motion(self, at: float) -> dict[str, Motion]:
        return {each.axis: each for each in self._shadow.motion(self.live(at))}

    def align(self, axis: str, position: int, at: float) -> None:
        self._shadow.align(axis, position, self.live(at))
        self.live(at)


def make(snapshot: Snapshot, begun: float, registers: bool, alone: bool) -> tuple[Twin, tuple[str, ...]]:
    """Make the twin of a drive that was read, with its gaps. Raises Inexpressible, or Diagnostic.

    `begun`: the time of the host's clock from which it lives. `alone`: no other drive is on the line.
    """
    described = snapshots_of(FAMILIES[snapshot.kind]).describe(snapshot)
    spec = cells.read(write([BusText(NAME, [described])]), NAME).buses[0].drives[0]
    unit = family_of(spec.personality).build(spec, Place(alone=alone))
    if unit.shadow is None:
        raise Inexpressible(f"the simulator has no twin of an {spec.personality}")
    gaps = [*described.remarks]
    if described.unread:
        gaps.append(f"not read, so as in a new drive: {', '.join(name for name, _ in described.unread)}")
    return Twin(unit, unit.shadow, snapshot.levels, begun, registers), tuple(gaps)


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
    commands = [each for each in concluded.transactions if each.request.kind not in ASKING]
    failed_with = commands[-1] if concluded.outcome.error is not None and commands else None
    for each in concluded.transactions:
        doubtful = each is failed_with and not each.reply.acknowledged
        polled = each.request.priority is Priority.POLL
        if each.sent and each.reply.end not in NOT_TAKEN and not doubtful and not polled:
            yield each


DRIFT = 0.005
"""The part of the time by which a program may run faster or slower than in the twin."""
LONGEST = 30.0
"""Seconds without a steady move whose drift is made good at once, at most."""
FADING = 0.95
"""The part of a delay that is still expected after a further reply."""
SWITCHES = {"lim+": "limit+", "lim-": "limit-"}
"""Limits by the function of their lamps."""


class Predicts(Protocol):
    """The part of a twin that a sample is compared with."""

    def motion(self, at: float) -> dict[str, Motion]:
        """Position and velocity of each axis at a time."""

    def align(self, axis: str, position: int, at: float) -> None:
        """Set the position of an axis at rest."""


T = TypeVar("T", bound=Predicts)


class Compared(Generic[T]):
    """A drive and what predicts its motion, axis by axis."""

    def __init__(self, twin: T) -> None:
        self.twin = twin
        self.doubtful = ""
        """The last line of which it is not known whether the drive executed it."""
        self.axes: dict[str, Comparison] = {}
        self.differences: dict[str, int] = {}
        """The last difference of each axis."""
        self._causes: dict[str, tuple[str, ...]] = {}
        """The candidates for the present difference of each axis."""
        self._took = 0.0
        """Seconds that the last sample may be uncertain: from its first to its last request, and its delay."""
        self._limits: dict[str, tuple[str, ...]] = {}

    def velocities(self, at: float) -> dict[str, int]:
        return {axis: motion.velocity for axis, motion in self.twin.motion(at).items()}

    @property
    def causes(self) -> tuple[str, ...]:
        """The candidates for the differences that are above the limit now, of all axes."""
        return tuple(dict.fromkeys(each for named in self._causes.values() for each in named))

    def comparison(self, axis: str) -> Comparison:
        return self.axes.setdefault(axis, Comparison())

    def disturbed(self, at: float, late: float = 0.0) -> None:
        """Note a command or an input at this time, or up to `late` s later.

        The end of a move that is under way depends on the moment.
        """
        for axis, velocity in self.velocities(at).items():
            self.comparison(axis).disturbed(velocity, late)

    def conditions(self, found: tuple[Conditions, ...]) -> None:
        """Take the lamps of the drive, which others read."""
        for each in found:
            lit = [SWITCHES[lamp.function] for lamp in each.lamps if lamp.on and lamp.function in SWITCHES]
            self._limits[each.axis] = tuple(lit)

    def sample(self, sample: Sample, rest: int) -> Iterator[TwinEvent]:
        """Compare a sample with the twin. `rest`: the limit at rest, steps."""
        expected = self.twin.motion(sample.at).get(sample.axis)
        if expected is None:  # a motor that the simulated module does not have
            return
        pair = Pair(sample.at, sample.position, sample.velocity, expected.position, expected.velocity)
        axis = self.comparison(sample.axis)
        self.differences[sample.axis] = pair.difference
        yield Predicted(sample.at, sample.address, expected.position, expected.velocity, pair.difference, sample.axis)
        axis.took = self._took
        verdict = axis.take(pair, rest)
        if verdict is not None:
            yield self.news(verdict, axis, sample.address, sample.axis, rest)
        if axis.rests(rest):
            if axis.slack and pair.difference:  # the end of the move could not be known to the step
                self.twin.align(sample.axis, sample.position, sample.at)
            axis.calm()

    def news(self, verdict: Verdict, comparison: Comparison, address: str, axis: str, rest: int) -> Diverged | Agreed:
        """Make the event of a verdict; an agreement shows that no line was lost."""
        pairs = list(comparison.pairs)
        if verdict is Verdict.AGREED:
            self.doubtful = ""
            self._causes.pop(axis, None)
            return Agreed(pairs[-1].at, address, axis)
        first = next((each for each in pairs if abs(each.difference) > comparison.limit(each, rest)), pairs[-1])
        last, self._causes[axis] = pairs[-1], causes(pairs, self.doubtful, self._limits.get(axis, ()))
        return Diverged(first.at, address, last.difference, comparison.limit(last, rest), self._causes[axis], axis)


class Beside(Compared[Twin]):
    """One drive with its twin. Times are those of the host's clock."""

    def __init__(self, drive: Drive, twin: Twin, begun: float) -> None:
        super().__init__(twin)
        self.drive, self.begun = drive, begun
        self._read_at = begun
        """When the inputs were last read."""
        self._in_step_at = begun
        self._quickest = inf
        """The shortest time from a reading's request to its reply, s."""
        self._delay = 0.0
        """Seconds by which the last replies came later than that: a request or a stop may take as much on its way."""

    def sample(self, sample: Sample, rest: int) -> Iterator[TwinEvent]:
        """Compare a sample with the twin, and keep the twin in step."""
        yield from super().sample(sample, rest)
        if (comparison := self.axes.get(sample.axis)) is not None:
            self._keep_step(comparison)

    def _keep_step(self, comparison: Comparison) -> None:
        """Shift the twin's time a little where a drive is early or late at an equal velocity.

        The lines of its program take another time than the simulator's. No shift changes where the two rest.
        """
        if not comparison.steady:
            return
        before, pair = list(comparison.pairs)[-2:]
        most = DRIFT * min(pair.at - self._in_step_at, LONGEST)
        late = pair.difference / copysign(pair.fastest, pair.predicted - before.predicted)
        self.twin.shift(max(-most, min(most, late)))
        self._in_step_at = pair.at

    # What reaches the twin

    def concluded(self, concluded: Concluded) -> None:
        if (took := reading_took(concluded)) is not None:
            last = concluded.transactions[-1]
            self._quickest = min(self._quickest, last.ended_at - last.transmitted_at)
            self._note_delay(last)
            self._took = took + self._delay
        for each in taken(concluded):
            data = each.request.codec.encode(each.request)
            disturbs = each.request.kind not in ASKING
            if disturbs and each.reply.acknowledged:
                self._note_delay(each)
            self._acts(data, each.transmitted_at, disturbs)
        if concluded.unproven:
            self.doubtful = concluded.unproven

    def _note_delay(self, transaction: Transaction) -> None:
        """Note how late a reply came. A delay that was seen fades with further replies."""
        delay = transaction.ended_at - transaction.transmitted_at - self._quickest
        self._delay = max(0.0, delay, FADING * self._delay)

    def stopped(self, data: bytes, at: float) -> None:
        """Take the bytes of a stop, or those that a person typed in raw mode."""
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


PERIOD = 0.1
"""Seconds between two samples of a drive, at most."""
INPUTS = 0.05
"""Seconds between two readings of the inputs of a drive, at most."""


class BusTwins:
    """The twins of the drives of a bus."""

    def __init__(self, bus: Bus, limit: int, publish: Callable[[TwinEvent], None], lost: Callable[[], None]) -> None:
        """`limit`: that at rest, steps. `lost`: called when the line is lost."""
        self.bus = bus
        self._limit = limit
        self.besides: dict[Drive, Beside] = {}
        self._waiting: dict[Drive, list[Concluded]] = {}
        """The conversations of a drive that is being read."""
        self._publish, self._lost = publish, lost
        self._departing = False
        """The bytes of a request are written next."""
        self._ends: list[Callable[[], None]] = [bus.watch(self._take), bus.witnesses.add(self._concluded)]
        self._polled: list[str] = []
        """The addresses that are read."""
        self._samples: Subscription[str] | None = None
        self._inputs: Subscription[Value] | None = None

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

    def begin(self, beside: Beside) -> None:
        """Begin to run a twin, with what its drive took meanwhile."""
        self.remove(beside.drive)
        self.besides[beside.drive] = beside
        for each in self._waiting.pop(beside.drive, ()):
            beside.concluded(each)
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
        addresses = self._polled = [each.address for each in self.besides]
        words = [
            Value(drive.address, beside.twin.levels.word)
            for drive, beside in self.besides.items()
            if beside.twin.levels is not None
        ]
        self._samples = telemetry.subscribe(addresses, PERIOD) if addresses else None
        self._inputs = telemetry.read(words, INPUTS) if words else None
        for each in before:
            if each is not None:
                each.close()

    # Events

    def _take(self, event: BusEvent) -> None:
        if isinstance(event, Sample):
            if (beside := self._at(event.address)) is not None:
                for news in beside.sample(event, self._limit):
                    self._publish(news)
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
        elif isinstance(event, Changed) and self._polled != [each.address for each in self.besides]:  # DN, PY
            self._poll()
        elif isinstance(event, Lost):
            self._lost()

    def _at(self, address: str) -> Beside | None:
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
