"""Cell files: what stands on a simulated shop floor, read from TOML into frozen dataclasses.

Every way in which a file can be wrong is a `Diagnostic` of one line that names the key and where it stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from types import MappingProxyType

from dialects import Diagnostic
from dialects.files import bytes_of, toml_of
from simulator.cell.models import MODELS
from simulator.cell.settings import Value, settings
from simulator.cell.table import Table, quoted

MCODE = tuple(MODELS)
ETHERNET = tuple(name for name, model in MODELS.items() if model.ethernet)
PERSONALITIES = (*MCODE, "PMX")
PMX_INPUTS, PMX_COUNTS = range(1, 9), 5000
"""Inputs of a PMX, and what its analog input reads at most."""
SCHEMES = ("pty", "tcp", "udp", "modbus")


@dataclass(frozen=True)
class Endpoint:
    """One entry of `serve`. `port` 0: any free one. `path`: the link to a pseudo-terminal, None for none."""

    text: str
    scheme: str
    host: str = ""
    port: int = 0
    path: Path | None = None


@dataclass(frozen=True)
class WorldSpec:
    """Around one axis: positions in motor steps, times in seconds after power-up, levels 1 (+V) and 0.

    `home`: the switch is closed up to there, or from the first place to the second. `locked`: the rotor is held fast
    from one time to another. Of a PMX only: `index` is the place of an index mark, `encoder` the counts that one motor
    step makes (decoded once), `slip` the part of the steps that are lost.
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


@dataclass(frozen=True)
class DriveSpec:
    """One drive. `world` is that of its motor; for a PMX that of x, and `world_y` that of y."""

    personality: str = "LMDCM"
    name: str = "!"
    party: bool = False
    set: Mapping[str, Value] = field(default_factory=lambda: MappingProxyType({}))
    program: str = ""
    program_name: str = ""
    instruction_us: float = 200.0
    world: WorldSpec = WorldSpec()
    world_y: WorldSpec = WorldSpec()

    @property
    def ethernet(self) -> bool:
        """Whether it is reached over Ethernet."""
        return self.personality in ETHERNET

    def assignments(self) -> Iterator[tuple[str, str]]:
        """`set` as pairs of mnemonic and value, in their order; `IS = ["1,1,0", "2,2,0"]` gives two."""
        for name, value in self.set.items():
            for each in value if isinstance(value, tuple) else (value,):
                yield name, str(each)


@dataclass(frozen=True)
class Faults:
    """What goes wrong on a wire: chances a byte, a range of reply delays (s), seconds until it hangs up."""

    flip: float = 0.0
    drop: float = 0.0
    delay: tuple[float, float] = (0.0, 0.0)
    hangup_after: float | None = None


@dataclass(frozen=True)
class BusSpec:
    """One wire, the drives on it and the ways in. `baud` 0: unpaced, and any baud is understood."""

    name: str
    serve: tuple[Endpoint, ...] = ()
    baud: int = 0
    drives: tuple[DriveSpec, ...] = ()
    faults: Faults = Faults()


@dataclass(frozen=True)
class Cell:
    """A shop floor."""

    seed: int = 0
    buses: tuple[BusSpec, ...] = ()


def load(path: str | Path) -> Cell:
    """Read a cell file. Raises Diagnostic."""
    path = Path(path)
    try:
        text = bytes_of(path).decode("utf-8")
    except UnicodeDecodeError:
        raise Diagnostic("is not UTF-8 text", str(path)) from None
    cell = parse(text, str(path), path.absolute().parent)
    if not cell.buses:
        raise Diagnostic("has no bus", str(path), "each begins with [[bus]]")
    return cell


def demo() -> Cell:
    """The cell that comes with the program."""
    folder = resources.files("simulator")
    return parse(folder.joinpath("demo.toml").read_text(encoding="utf-8"), "demo cell", folder)


def parse(text: str, where: str = "cell", folder: Traversable | None = None) -> Cell:
    """Read a cell's text; its paths are relative to `folder` (None: the current one). Raises Diagnostic."""
    table = Table(toml_of(text, where), where)
    table.only("seed", "bus")
    here = Path.cwd() if folder is None else folder
    cell = Cell(
        seed=table.integer("seed", 0),
        buses=tuple(_bus(each, where, here) for each in table.tables("bus", "[[bus]]")),
    )
    _check_cell(cell, where)
    return cell


def _bus(table: Table, where: str, folder: Traversable) -> BusSpec:
    name = table.values.get("name")
    if isinstance(name, str) and name:
        table = Table(table.values, f"{where}: [[bus]] {quoted(name)}")
    table.only("name", "serve", "baud", "drive", "faults")
    name = table.text("name")
    if not name or not name.isprintable() or set(name) & set("#@:/ "):
        raise table.wrong("name", f"cannot be {quoted(name)}", "a word without spaces, #, @, : or /")
    bus = BusSpec(
        name=name,
        serve=tuple(_endpoint(each, table, folder) for each in table.texts("serve")),
        baud=table.integer("baud", 0, low=0, high=4_000_000),
        drives=tuple(_drive(each, folder) for each in table.tables("drive", "[[bus.drive]]")),
        faults=_faults(table.table("faults", "[bus.faults]")),
    )
    _check_bus(bus, table)
    return bus


def _endpoint(text: str, table: Table, folder: Traversable) -> Endpoint:
    scheme, colon, rest = text.partition(":")
    if not colon or scheme not in SCHEMES:
        raise table.wrong(
            "serve", f"cannot be {quoted(text)}", "an entry begins with pty:, tcp://, udp:// or modbus://"
        )
    if scheme == "pty":
        if not rest.isprintable():
            raise table.wrong("serve", f"cannot be {quoted(text)}")
        return Endpoint(text, scheme, path=Path(str(folder), rest) if rest else None)
    host, colon, port = rest.removeprefix("//").rpartition(":")
    if not (colon and port.isascii() and port.isdigit() and len(port) < 6 and int(port) < 65536):
        raise table.wrong("serve", f"{quoted(text)} has no port", f"for any free one: {scheme}://127.0.0.1:0")
    if not all(c.isalnum() or c in "-._[]:" for c in host):
        raise table.wrong("serve", f"{quoted(text)} has no such host", f"as in {scheme}://127.0.0.1:0")
    return Endpoint(text, scheme, host.strip("[]") or "127.0.0.1", int(port))


def _drive(table: Table, folder: Traversable) -> DriveSpec:
    table.only("personality", "name", "party", "set", "program", "instruction_us", "world")
    personality = table.choice("personality", PERSONALITIES)
    pmx = personality == "PMX"
    name = table.text("name", "00" if pmx else "!")
    if pmx and not (len(name) == 2 and name.isascii() and name.isdigit()):
        raise table.wrong("name", f"cannot be {quoted(name)}", "a PMX has two digits, 00 to 99")
    if not pmx and not (len(name) == 1 and name.isascii() and (name.isalnum() or name == "!")):
        raise table.wrong("name", f"cannot be {quoted(name)}", "one of a-z, A-Z, 0-9 or !")
    party = table.boolean("party", False)
    if pmx and party:
        raise table.wrong("party", "is for MCode drives", "leave it out: a PMX always has an address")
    program_name = table.text("program", "")
    world, world_y = _worlds(table.table("world", "[bus.drive.world]"), personality)
    return DriveSpec(
        personality=personality,
        name=name,
        party=party,
        set=settings(table.table("set", "set"), personality),
        program=_program(program_name, table, folder),
        program_name=program_name,
        instruction_us=table.number("instruction_us", 200.0, low=0.0, high=1e6),
        world=world,
        world_y=world_y,
    )


def _program(name: str, table: Table, folder: Traversable) -> str:
    if not name:
        return ""
    try:
        file = folder.joinpath(name)
        if not file.is_file():
            raise table.wrong("program", f"{quoted(name)} is not there", "paths are relative to the cell file")
        return file.read_bytes().decode("utf-8", "replace")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "not a path"
        raise table.wrong("program", f"{quoted(name)} cannot be read ({why})") from None


def _worlds(table: Table, personality: str) -> tuple[WorldSpec, WorldSpec]:
    keys: tuple[str, ...] = ("home", "limit_plus", "limit_minus", "stall_at", "load", "inputs", "analog", "locked")
    if personality in MODELS:
        points = MODELS[personality].points
        table.only(*keys)
        return _world(table, points.inputs, points.analog), WorldSpec()
    keys += ("index", "encoder", "slip")
    table.only(*keys, "x", "y")
    x, y = table.table("x", "[bus.drive.world.x]"), table.table("y", "[bus.drive.world.y]")
    x.only(*keys)
    y.only(*keys)
    for key in keys:
        if key in x.values and key in table.values:
            raise x.wrong(key, "is given twice", "flat keys mean x")
    both = Table({**table.values, **x.values}, x.where if x.values else table.where)
    return _world(both, PMX_INPUTS, PMX_COUNTS), _world(y, PMX_INPUTS, PMX_COUNTS)


def _world(table: Table, inputs: Sequence[int], counts: int) -> WorldSpec:
    changes = table.rows("inputs", (("seconds", 0, 1e9), ("input", min(inputs), max(inputs)), ("level", 0, 1)))
    for _, n, _ in changes:
        if n not in inputs:
            raise table.wrong("inputs", f"has no input {n:g}", f"they are {', '.join(map(str, sorted(inputs)))}")
    analog = table.rows("analog", (("seconds", 0, 1e9), ("counts", 0, counts)))
    locked = table.rows("locked", (("from", 0, 1e9), ("to", 0, 1e9)))
    for begin, end in locked:
        if begin >= end:
            raise table.wrong("locked", f"rows must go up, not from {begin:g} to {end:g}")
    return WorldSpec(
        home=table.edges("home"),
        limit_plus=table.position("limit_plus"),
        limit_minus=table.position("limit_minus"),
        stall_at=table.position("stall_at"),
        load=table.number("load", 0.0, low=0.0, high=10.0),
        inputs=tuple((t, int(n), int(level)) for t, n, level in changes),
        analog=tuple((t, int(value)) for t, value in analog),
        locked=tuple((begin, end) for begin, end in locked),
        index=table.number("index", 800.0, low=-(2.0**40), high=2.0**40),
        encoder=table.number("encoder", 1.0, low=0.0, high=1000.0),
        slip=table.number("slip", 0.0, low=0.0, high=1.0),
    )


def _faults(table: Table) -> Faults:
    table.only("flip", "drop", "delay", "hangup_after")
    low, high = table.span("delay")
    return Faults(
        flip=table.number("flip", 0.0, low=0.0, high=1.0),
        drop=table.number("drop", 0.0, low=0.0, high=1.0),
        delay=(low, high),
        hangup_after=table.number("hangup_after", 0.0, low=0.0) if "hangup_after" in table.values else None,
    )


def _check_bus(bus: BusSpec, table: Table) -> None:
    """Drives that cannot share a wire, or that the endpoints cannot reach."""
    names: dict[str, int] = {}
    for number, drive in enumerate(bus.drives, 1):
        where = f"{table.where}: [[bus.drive]] {number}"
        if len(bus.drives) > 1 and drive.ethernet:
            raise Diagnostic(f"an {drive.personality} cannot share its bus", where, "give it a bus of its own")
        if len(bus.drives) > 1 and drive.personality != "PMX" and not drive.party:
            raise Diagnostic(
                "without party mode it answers everything on a bus that it shares", where, "add party = true"
            )
        if drive.name in names:
            raise Diagnostic(f'"{drive.name}" is the name of [[bus.drive]] {names[drive.name]} too', where)
        names[drive.name] = number
    if any(each.scheme == "modbus" for each in bus.serve) and not any(each.ethernet for each in bus.drives):
        raise table.wrong("serve", "has modbus:// but no drive that speaks it", "those are LMDOE and LMDCE")


def _check_cell(cell: Cell, where: str) -> None:
    """What may be there only once in a cell: the name of a bus, a link, a port (0 is any free one)."""
    names: set[str] = set()
    taken: dict[object, str] = {}
    for bus in cell.buses:
        if bus.name in names:
            raise Diagnostic(f'two buses are called "{bus.name}"', where)
        names.add(bus.name)
        for each in bus.serve:
            place = each.path or (each.port and (each.scheme == "udp", each.host, each.port))
            if place and place in taken:
                message = f"serve {quoted(each.text)} is taken by {quoted(taken[place])}"
                raise Diagnostic(message, f"{where}: [[bus]] {quoted(bus.name)}")
            taken[place] = each.text
