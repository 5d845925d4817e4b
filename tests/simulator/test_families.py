"""The table of simulated families, and a third family that no module of the simulator knows."""

from __future__ import annotations

import ast
from pathlib import Path
from struct import Struct

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.families.lexium.simulator.state.models import MODELS
from multidrop.simulator.cell.drive_keys import WORLD_KEYS, common_keys, read_worlds
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.cell.table import Folder, Table
from multidrop.simulator.cells import CellReader
from multidrop.simulator.declared import simulated
from multidrop.simulator.families import BY_PERSONALITY, FAMILIES, family_of
from multidrop.simulator.family import Place, SimulatedFamily, Unit
from multidrop.simulator.wire import Transmission, Wire
from multidrop.simulator.world import World

FRAME = Struct(">BBBBiB")


class Frames:
    """A port that takes frames of nine bytes for its address, and replies with the sum of what it got."""

    baud = 0
    deadline = None

    def __init__(self, address: int) -> None:
        self.address = address
        self.received: list[bytes] = []
        self._begun = b""
        self._out: list[Transmission] = []

    def quiet(self, now: float) -> bool:
        return not self._out

    def hears(self, byte: int) -> bool:
        return True

    def completes(self, data: bytes) -> bool:
        return len(self._begun) + len(data) >= FRAME.size

    def urgent(self, data: bytes) -> bool:
        return False

    def receive(self, data: bytes, now: float) -> None:
        self._begun += data
        while len(self._begun) >= FRAME.size:
            frame, self._begun = self._begun[: FRAME.size], self._begun[FRAME.size :]
            if frame[0] == self.address:
                self.received.append(frame)
                self._out.append(Transmission(now, bytes((2, self.address, 100)) + frame[1:2] + frame[4:9]))

    def sent(self, now: float) -> list[Transmission]:
        out, self._out = self._out, []
        return out

    def overhear(self, data: bytes, now: float) -> None:
        raise AssertionError("replies are not overheard")


class Module:
    """A device that does nothing."""

    powered = True

    def advance(self, now: float) -> None: ...
    def power(self, on: bool, now: float) -> None: ...
    def supply(self, on: bool, now: float) -> None: ...


def read_drive(table: Table, folder: Folder) -> DriveSpec:
    name = table.text("name", "1")
    if not (name.isascii() and name.isdigit() and 1 <= int(name) <= 255):
        raise table.wrong("name", "must be 1 to 255")
    first, *rest = read_worlds(table.table("world", "[bus.drive.world]"), ("0", "1", "2"), WORLD_KEYS, range(8), 4095)
    return DriveSpec(**common_keys(table, folder), name=name, world=first, further=tuple(rest))


def build(spec: DriveSpec, place: Place) -> Unit:
    worlds = {str(n): World(each) for n, each in enumerate((spec.world, *spec.further))}
    return Unit(Module(), Frames(int(spec.name)), worlds, inputs=range(8), counts=4095)


class Toy(SimulatedFamily):
    """The third family."""

    name = "toy"
    addressed = True

    @classmethod
    def read_drive(cls, table: Table, folder: Folder) -> DriveSpec:
        return read_drive(table, folder)

    @classmethod
    def build(cls, spec: DriveSpec, place: Place) -> Unit:
        return build(spec, place)


CELL = """
[[bus]]
name = "lab"
[[bus.drive]]
personality = "TOYM"
name = "13"
[bus.drive.world.2]
home = [-5, 5]
[[bus.drive]]
personality = "TOYM"
name = "27"
"""


def frame(address: int, command: int, value: int) -> bytes:
    raw = FRAME.pack(address, command, 0, 0, value, 0)
    return raw[:-1] + bytes([sum(raw) & 0xFF])


def run(wire: Wire, until: float = 10.0) -> bytes:
    heard = b""
    while (at := wire.deadline) is not None and at <= until:
        heard += wire.advance(at)
    return heard


def test_a_cell_reads_drives_of_the_families_that_it_is_given() -> None:
    cell = CellReader({**BY_PERSONALITY, "TOYM": Toy}).read(CELL)
    first, second = cell.buses[0].drives
    assert (first.personality, first.name, second.name) == ("TOYM", "13", "27")
    assert first.further == (WorldSpec(), WorldSpec(home=(-5, 5)))
    with pytest.raises(Diagnostic, match='personality cannot be "TOYM"'):
        CellReader(BY_PERSONALITY).read(CELL)


@pytest.mark.parametrize("baud", [0, 9600])
@pytest.mark.parametrize("value", [0x0D0A1B03, 0x0305402A, -1])
def test_a_wire_carries_frames_in_which_keys_of_other_families_occur(baud: int, value: int) -> None:
    ports = [build(DriveSpec("TOYM", name), Place(baud, alone=False)).port for name in ("13", "27")]
    wire = Wire(ports, baud)
    asked = [frame(27, 13, value), frame(13, 3, value), frame(7, 6, value), frame(13, 27, value)]
    replies = []
    for n, each in enumerate(asked):
        wire.receive(each, float(n))
        replies.append(run(wire, n + 0.9))
    assert replies[2] == b"", "nobody has address 7"
    expected = [(27, 13), (13, 3), None, (13, 27)]
    for reply, who, each in zip(replies, expected, asked, strict=True):
        assert reply == (bytes((2, who[0], 100, who[1])) + each[4:9] if who else b"")


def test_a_flood_of_frames_waits_at_the_end_of_a_frame_and_loses_nothing() -> None:
    port = Frames(1)
    wire = Wire([port, Frames(2)], 0)
    asked = [frame(1, 6, n) for n in range(2000)]
    wire.receive(b"".join(asked), 0.0)
    heard = wire.advance(0.0)
    assert len(port.received) < len(asked) or len(heard) == 9 * len(asked)
    for n in range(100):
        heard += wire.advance(float(n))
    assert port.received == asked and len(heard) == 9 * len(asked)


def test_each_row_has_the_name_and_the_products_of_its_family() -> None:
    assert {name: family.name for name, family in FAMILIES.items()} == {name: name for name in simulated()}
    assert [name for name in BY_PERSONALITY if family_of(name) is FAMILIES["mcode"]] == list(MODELS)
    assert len(BY_PERSONALITY) == sum(len(row.personalities) for row in simulated().values())


def test_nothing_of_the_simulator_but_the_table_and_the_families_names_a_family() -> None:
    root = Path(__file__).parents[2] / "simulator"
    names = {*FAMILIES, *BY_PERSONALITY} - {DriveSpec().personality}
    families = {path.parent for path in root.glob("*/family.py")}
    for path in root.rglob("*.py"):
        if not set(path.parents) & families and path != root / "families.py":
            nodes = ast.walk(ast.parse(path.read_text("utf-8")))
            assert not {node.value for node in nodes if isinstance(node, ast.Constant)} & names, path
