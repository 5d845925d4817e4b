"""The class of a simulated family: what the cell, the floor, program tests and `/sim` need to know of its drives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar, NamedTuple, Protocol

from multidrop.base.errors import Diagnostic
from multidrop.dialects.family import Motion
from multidrop.dialects.values import Snapshot, Value
from multidrop.simulator.cell.drive_keys import common_keys
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.cell.table import Folder, Table
from multidrop.simulator.cell.writer import DriveText
from multidrop.simulator.kinematics import Effort as Effort
from multidrop.simulator.wire import Port
from multidrop.simulator.world import Shaft, World


class Device(Protocol):
    """The operations that `/sim` needs on any simulated drive; `advance` sees what has changed around it."""

    @property
    def powered(self) -> bool: ...  # noqa: D102
    def advance(self, now: float) -> None: ...  # noqa: D102
    def power(self, on: bool, now: float) -> None: ...  # noqa: D102
    def supply(self, on: bool, now: float) -> None: ...  # noqa: D102


class PortConnection(Protocol):
    """One client's connection to the own port of an Ethernet drive."""

    @property
    def closed(self) -> bool:
        """Whether the client sent bytes that make no sense; it should be disconnected."""

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes; give the replies to the messages that they complete."""


@dataclass(frozen=True)
class Place:
    """The bus that a drive is built for. `baud` 0: bytes take no time. `alone`: no other drive is on it."""

    baud: int = 0
    alone: bool = True


@dataclass(frozen=True)
class Shadow:
    """The operations of a simulated drive that runs beside a real one: they need no wire."""

    rest: Callable[[], None]
    """End the work of power-up, and take lines as a drive that a host has talked to; at time 0."""
    motion: Callable[[float], tuple[Motion, ...]]
    """Position and velocity of each axis at a time, as the drive reports them."""
    align: Callable[[str, int, float], None]
    """Let an axis stand, whatever it does, and set its position counter."""
    awaits: Callable[[str, float], str | None]
    """What the homing of an axis awaits: `home`, `limit_plus`, `limit_minus`; empty: no switch. None: it has none."""
    efforts: Callable[[], Mapping[str, Effort]]
    """What each axis commands now."""
    shafts: Mapping[str, Shaft] = field(default_factory=lambda: MappingProxyType({}))
    """The shafts of the axes whose switches are no inputs, by the name of the axis."""


class UsbSide(NamedTuple):
    """The lines that a simulated drive takes on its USB interface (`dialects.usb.UsbModule`)."""

    serial: Callable[[], str]
    """Its serial number there, as its settings have it now."""
    execute: Callable[[str, float], str]
    """Carry out a line at a time; return the reply."""


@dataclass(frozen=True)
class Unit:
    """A simulated drive with its port and its surroundings.

    `worlds` are those of its axes, by the name that `/sim` gives them; "" where there is only one. `inputs` are the
    numbers of its inputs, `counts` is the end of scale of its analog input. `single_supply`: it has no auxiliary
    supply. `connect` makes a connection to its own port (`Simulated.own_port`); None: it has none.
    """

    device: Device
    port: Port
    worlds: Mapping[str, World]
    inputs: Sequence[int] = ()
    counts: int = 0
    single_supply: bool = False
    connect: Callable[[], PortConnection] | None = None
    shadow: Shadow | None = None
    """None: it cannot run beside a real drive."""
    on_usb: UsbSide | None = None
    """None: it has no USB."""


@dataclass(frozen=True)
class StoredProgram:
    """The program of a drive in a cell file. `lines`: as the drive lists them, in canonical spelling.

    `file`: the lines of a file that loads it, with the user's variables. `labels`: those that it defines.
    """

    lines: tuple[str, ...] = ()
    file: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()


class SimulatedFamily(ABC):
    """The simulated drives of one language. The class itself is what cells and the floor ask."""

    name: ClassVar[str]
    """That of the language on the host's side."""
    ethernet: ClassVar[frozenset[str]] = frozenset()
    """The personalities that are reached over Ethernet, alone on their bus."""
    addressed: ClassVar[bool] = False
    """A drive replies only to its own address; otherwise a shared bus needs party mode."""
    keys: ClassVar[tuple[str, ...]] = ()
    """Keys of `[[bus.drive]]` that only its drives have."""

    @classmethod
    def read_drive(cls, table: Table, folder: Folder) -> DriveSpec:
        """Read the table of a drive in a cell file; by default its name and what all have. Raises Diagnostic."""
        return DriveSpec(**common_keys(table, folder), name=table.text("name", DriveSpec.name))

    @classmethod
    @abstractmethod
    def build(cls, spec: DriveSpec, place: Place) -> Unit:
        """Build a drive that is powered up. Raises Diagnostic for settings that it refuses, and for a program."""

    @classmethod
    def describe(cls, snapshot: Snapshot) -> DriveText:
        """Make the table of a drive that was read. Raises Diagnostic where the family makes none."""
        raise cls._none()

    @classmethod
    def wanted(cls, spec: DriveSpec) -> Mapping[str, Value]:
        """The settings of a drive in a cell file, as the host's side of the family names them. Raises Diagnostic."""
        raise cls._none()

    @classmethod
    def program(cls, spec: DriveSpec) -> StoredProgram:
        """The program of a drive in a cell file. Raises Diagnostic for one that the drive refuses."""
        return StoredProgram()

    @classmethod
    def _none(cls) -> Diagnostic:
        return Diagnostic(f"the simulator has no snapshots of the family {cls.name}")
