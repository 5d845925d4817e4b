"""The climate of a seed: how probable each kind of fault is. One seed in ten has none but what the story does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from random import Random

from multidrop.simulator.cell.spec import Faults

FAULTS = {
    # of the wire, each byte
    "flip": 2e-3,
    "drop": 2e-3,
    "double": 2e-3,
    "insert": 2e-3,
    "late": 2e-2,
    "delay": 0.5,
    # of the kernel, each read or write
    "part": 0.5,
    "full": 0.5,
    "split": 0.8,
    "late read": 0.5,
    # of the network, each segment, datagram, connection or reply
    "net late": 0.05,
    "slow connect": 0.3,
    "refused": 0.3,
    "datagram lost": 0.1,
    "datagram doubled": 0.05,
    "datagram late": 0.1,
    "reply late": 0.1,
    "reply again": 0.1,
    "reply of another": 0.05,
    # of USB, each packet
    "usb late": 0.2,
    "usb missing": 0.1,
    "usb held": 0.1,
    "usb stalled": 0.02,
    "usb empty": 0.1,
    # of the loop and of threads, each turn or step
    "late timer": 0.02,
    "slow thread": 0.3,
    # of the disk, each operation
    "disk full": 0.2,
    "fsync refused": 0.2,
    "slow disk": 0.02,
}
"""The greatest probability of each kind (`delay`: the longest turn of a drive, s)."""


@dataclass(frozen=True)
class Climate:
    """The probabilities of a seed, by kind of fault; a kind that is not named does not happen."""

    seed: int
    chances: dict[str, float] = field(default_factory=dict)
    happened: Counter[str] = field(default_factory=Counter, compare=False)
    """How often each kind has happened, but for those of the wire: the history has what they changed."""

    @classmethod
    def drawn(cls, seed: int, without: Collection[str] = ()) -> Climate:
        """Draw each fault's own probability, whatever other kinds there are. `without`: kinds that are left out."""
        if Random(f"{seed} calm").random() < 0.1:
            return cls(seed)
        draws = {kind: Random(f"{seed} {kind}") for kind in FAULTS if kind not in without}
        return cls(seed, {kind: rng.random() ** 3 * FAULTS[kind] for kind, rng in draws.items() if rng.random() < 0.5})

    @property
    def calm(self) -> bool:
        """Nothing happens but what the story does: stops, kills, power-offs."""
        return not self.chances

    def __getitem__(self, kind: str) -> float:
        """The probability of a kind."""
        assert kind in FAULTS, kind
        return self.chances.get(kind, 0.0)

    def happens(self, kind: str, rng: Random) -> bool:
        """Draw whether a fault of this kind happens now."""
        found = rng.random() < self.chances.get(kind, 0.0)
        if found:
            self.happened[kind] += 1
        return found

    @property
    def wire(self) -> Faults:
        """The faults of a wire."""
        each = {kind: self[kind] for kind in ("flip", "drop", "double", "insert", "late")}
        longest = 0.1 + Random(f"{self.seed} late by").random() ** 3 * 1.5
        return Faults(**each, late_by=(0.01, longest), delay=(0.0, self["delay"]))
