"""The twins of one bus: its events reach them, and what they predict is published beside the samples.

Theory of operation. A twin has no timer. It lives up to the time of each sample, and of what its drive took. No
sample of a drive comes in the middle of a conversation with it. So a conversation reaches the twin as a whole, once it
is over. Bytes without a request are a stop, or a person's own: they reach every twin at once.
"""

from __future__ import annotations

from collections.abc import Callable

from multidrop.dialects.values import Snapshot
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.events import BusEvent, Changed, Concluded, Conditioned, Lost, Sample, Sent, Traffic, Valued
from multidrop.drives.port_journal import GLOBAL
from multidrop.drives.telemetry import Subscription, Value
from multidrop.shell.events import TwinEnded, TwinEvent
from multidrop.shell.twins.pair import Beside

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
        """Set the limit at rest."""
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
        """End a twin."""
        if (beside := self.besides.pop(drive, None)) is not None:
            self._publish(TwinEnded(self.bus.now(), beside.drive.address))

    def close(self) -> None:
        """End all twins and their readings."""
        for drive in list(self.besides):
            self.remove(drive)
        self._poll()
        while self._ends:
            self._ends.pop()()

    def _poll(self) -> None:
        """Read position, velocity and inputs of the drives with a twin."""
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
            self._sample(event)
        elif isinstance(event, Sent):
            self._departing = True
        elif isinstance(event, Traffic):
            self._traffic(event)
        elif isinstance(event, Valued):
            self._valued(event)
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

    def _sample(self, sample: Sample) -> None:
        if (beside := self._at(sample.address)) is None:
            return
        for event in beside.sample(sample, self._limit):
            self._publish(event)
        self._pass_on(beside, sample.at)

    def _valued(self, event: Valued) -> None:
        beside = self._at(event.address)
        if beside is not None and beside.twin.levels is not None and event.word == beside.twin.levels.word:
            beside.inputs(int(event.value), event.at)

    def _traffic(self, event: Traffic) -> None:
        if not event.outgoing:
            return
        if self._departing:
            self._departing = False
            return
        for beside in self.besides.values():
            beside.stopped(event.data, event.at)

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

    def _pass_on(self, beside: Beside, at: float) -> None:
        """Have the other twins overhear what one has printed for them."""
        for data in beside.twin.printed():
            for other in self.besides.values():
                if other is not beside:
                    other.twin.overhear(data, at)
