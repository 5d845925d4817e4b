"""What a cell file describes, as frozen dataclasses: buses, their drives, and the world around each axis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from pathlib import Path

    from multidrop.dialects.units import Scale

Scalar = int | float | str
Value = Scalar | tuple[str, ...]
"""A value of `set`: one line to the drive, or several."""


class Endpoint(NamedTuple):
    """One entry of `serve`. `port` 0: any free port. `path`: the link to a pseudo-terminal; None: no link."""

    text: str
    scheme: str
    host: str = ""
    port: int = 0
    path: Path | None = None


class MotorSpec(NamedTuple):
    """A motor at full current: rows of speed, rev/s, from 0 up, and torque, N m; the inertia of its rotor, kg m2."""

    curve: tuple[tuple[float, float], ...]
    inertia: float = 0.0


@dataclass(frozen=True)
class WorldSpec:
    """The surroundings of one axis: positions in motor steps, times in seconds from power-up, levels 1 (+V) and 0.

    `home`: the switch is closed up to this position, or between two. `locked`: times between which the rotor is held
    fast. For drives with a separate encoder: `index` is the position of an index mark, `encoder` the counts of one
    motor step (decoded once), `slip` the fraction of the steps that is lost. `friction` (N m for a rev/s) and `inertia`
    (kg m2) are for a drive with a `motor`.
    """

    home: float | tuple[float, float] | None = None
    limit_plus: float | None = None
    limit_minus: float | None = None
    stall_at: float | None = None
    load: float = 0.0
    inputs: tuple[tuple[float, int, int], ...] = ()
    analog: tuple[tuple[float, int], ...] = ()
    locked: tuple[tuple[float, float], ...] = ()
    index: float = 800.0
    encoder: float = 1.0
    slip: float = 0.0
    friction: float = 0.0
    inertia: float = 0.0
    motor: MotorSpec | None = None
    """The motor that turns it; None: any torque."""


@dataclass(frozen=True)
class Identity:
    """What one unit reports of itself, and its counters as the cell begins; an empty text: as its personality does.

    `counters` has a value for each axis, by the key of the table; a counter that is left out begins at 0.
    """

    part: str = ""
    version: str = ""
    serial: str = ""
    counters: Mapping[str, tuple[int, ...]] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True)
class DriveSpec:
    """One drive. `world` surrounds its first axis, `further` each of the others. `variables` are the user's.

    `cse`: the cyber security of an Ethernet drive is on, so it replies to nothing.
    """

    personality: str = "LMDCM"
    name: str = "!"
    party: bool = False
    set: Mapping[str, Value] = field(default_factory=lambda: MappingProxyType({}))
    variables: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    program: str = ""
    program_name: str = ""
    instruction_us: float = 200.0
    identity: Identity = Identity()
    world: WorldSpec = WorldSpec()
    further: tuple[WorldSpec, ...] = ()
    any_address: bool = False
    """It replies to every address."""
    cse: bool = False
    units: Mapping[str, Scale] = field(default_factory=lambda: MappingProxyType({}))
    """The scales of its axes, by their names; the empty name is an only axis."""

    def assignments(self) -> Iterator[tuple[str, str]]:
        """Yield `set` as pairs of name and value, in order; `IS = ["1,1,0", "2,2,0"]` gives two pairs."""
        for name, value in self.set.items():
            for part in value if isinstance(value, tuple) else (value,):
                yield name, str(part)


@dataclass(frozen=True)
class Faults:
    """Faults of a wire: probabilities for each byte, ranges of delays (s), the time at which it hangs up (s).

    `hangup_for`: seconds until it is plugged in again, when `hangup_after` begins again; None: never.
    """

    flip: float = 0.0
    drop: float = 0.0
    double: float = 0.0
    insert: float = 0.0
    late: float = 0.0
    late_by: tuple[float, float] = (0.01, 0.2)
    delay: tuple[float, float] = (0.0, 0.0)
    hangup_after: float | None = None
    hangup_for: float | None = None

    @property
    def harmful(self) -> bool:
        """Whether they change bytes."""
        return bool(self.flip or self.drop or self.double or self.insert)


class BusSpec(NamedTuple):
    """One wire, the drives on it and the ways in. `baud` 0: bytes take no time, and any baud rate is understood.

    `gather`: pty and TCP endpoints of serial drives deliver together the bytes that follow each other within this time,
    s; None: two character times.
    """

    name: str
    serve: tuple[Endpoint, ...] = ()
    baud: int = 0
    drives: tuple[DriveSpec, ...] = ()
    faults: Faults = Faults()
    gather: float | None = None


class Cell(NamedTuple):
    """A simulated shop floor."""

    seed: int = 0
    own_units: tuple[str, ...] = ()
    buses: tuple[BusSpec, ...] = ()
