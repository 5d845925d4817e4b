"""The family of simulated MCode drives: built from a cell file's `[[bus.drive]]` table, which is read and written here.

A drive as it was read from a unit becomes such a table, and a table the settings to write to a unit.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from fractions import Fraction
from functools import partial

from multidrop.dialects.family import Motion
from multidrop.dialects.units import Scale
from multidrop.dialects.values import VARIABLES, Reading, Scalar, Snapshot, Value, same
from multidrop.families.lexium.manual.grammar import is_name, parsed
from multidrop.families.lexium.manual.groups import LISTS, TRIPS
from multidrop.families.lexium.manual.statements import UNNAMED, canonical, size_of
from multidrop.families.lexium.manual.table import lookup, words
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.lexium.simulator.ports.mcode import MCodePort
from multidrop.families.lexium.simulator.ports.modbus import ModbusPort
from multidrop.families.lexium.simulator.power import BAUDS
from multidrop.families.lexium.simulator.state.memory import Memory
from multidrop.families.lexium.simulator.state.models import MODELS
from multidrop.simulator.cell.drive_keys import (
    WORLD_KEYS,
    AxisScale,
    common_keys,
    read_identity,
    read_settings,
    read_units,
    read_variables,
    read_world,
)
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.cell.table import Folder, Table, quoted, shown
from multidrop.simulator.cell.writer import CellEntry, DriveText, plain, remark
from multidrop.simulator.family import Place, Shadow, SimulatedFamily, StoredProgram, Unit
from multidrop.simulator.wire import Transmission
from multidrop.simulator.world import REVOLUTION, World

KEY_OF = {"DN": "name", "PY": "party"}
"""Mnemonics that have a key of their own in the table."""


def _axis_scale(personality: str, settings: Mapping[str, Value], scales: Mapping[str, Scale]) -> AxisScale:
    """A count is a motor step, or an encoder count where the drive moves in these (manual 3.4.2)."""
    memory = Memory(personality)
    memory.values.update((name, held) for name, held in settings.items() if isinstance(held, int | float))
    lines = memory.values.get("EL", memory.model.encoder_lines)
    turn = lines * 4 if memory.counting else memory.steps_per_turn
    return AxisScale(scales.get(""), Fraction(REVOLUTION), Fraction(REVOLUTION) / Fraction(turn))


def _check(personality: str, table: Table, word: str, value: Value) -> None:
    """Refuse a mnemonic of `set` that the product does not have, and a value that it does not take."""
    if (key := KEY_OF.get(word.upper())) is not None:
        raise table.wrong(word, "has a key of its own", f'use "{key}"')
    row = lookup(word, personality)
    if row is None:
        settable = [name for name, each in words(personality).items() if "W" in each.access and name.isalnum()]
        near = get_close_matches(word.upper(), settable, n=1)
        hint = f'did you mean "{near[0]}"?' if near else ""
        raise table.wrong(quoted(word), f"is not an MCode mnemonic of an {personality}", hint)
    if "W" not in row.access:
        raise table.wrong(word, f"cannot be set ({row.title})")
    encoder = table.values.get("EE") == 1 and not table.values.get("AS")
    if isinstance(value, (int, float)) and not row.accepts(value, encoder):
        low, high = row.bounds(encoder)
        wanted = f"one of {', '.join(map(str, row.values))}" if row.values else f"from {low} to {high}"
        raise table.wrong(word, f"must be {wanted}, not {shown(value)}")


_LISTED = re.compile(rf"({'|'.join(LISTS)})(\d+)")
"""Settings of which a cell file has one list."""
_NAMED = re.compile(r"\s*(?:LB|VA)[\s=]+([A-Z][A-Z0-9]{0,2})", re.I)
Row = tuple[int, str]
"""A program line and its address."""


def nearest(product: str) -> str:
    """The personality of a product; for one that is not simulated the one that is most like it."""
    if product in MODELS:
        return product
    if product.startswith("LMM"):
        return "LMM"
    if product.startswith("LM"):
        return "LMDCE" if product.endswith("E") else "LMDCM"
    return "MDI"


def _settings(readings: list[Reading], personality: str) -> Iterator[CellEntry]:
    lists: dict[str, list[str]] = {}
    for reading in readings:
        row = _LISTED.fullmatch(reading.name)
        if row is not None:
            lists.setdefault(row[1], []).append(f"{row[2]},{_fields(reading.value)}")
        elif _acceptable(reading, personality) and not _unset(reading, personality):
            huge = isinstance(reading.value, float) and abs(reading.value) >= 2.0**63
            held = _fields(reading.value) if isinstance(reading.value, tuple) else reading.value
            yield CellEntry(reading.name, repr(reading.value) if huge else held, remark(reading))
    for name, rows in lists.items():
        yield CellEntry(name, rows)


def _unset(reading: Reading, personality: str) -> bool:
    """Return whether nothing was set: a default that cannot be written, and PF, which pads once it is set.

    A trip without a set-up has the default 0.
    """
    if reading.name == "PF" or reading.name in TRIPS:
        return same(reading.value, reading.default)
    return same(reading.value, reading.default) and not _acceptable(reading, personality)


def _acceptable(reading: Reading, personality: str) -> bool:
    """Return whether the simulated drive takes a number, whatever the unit of motion is."""
    row = lookup(reading.name, personality)
    if row is None or isinstance(reading.value, (tuple, str)):
        return True
    return row.accepts(reading.value, True) or row.accepts(reading.value, False)


def _fields(held: Value) -> str:
    return ",".join(map(str, held)) if isinstance(held, tuple) else str(held)


def _scalar(text: str) -> Scalar:
    text = text.strip().upper()
    return int(text) if re.fullmatch(r"-?\d+", text) else text


def _placed(rows: Sequence[Row], personality: str, variables: Iterable[str]) -> tuple[list[str], list[str]]:
    """Program lines with PG wherever the simulated drive would store the next one elsewhere; remarks on addresses."""
    names = _names(rows, variables)
    lines: list[str] = []
    following = moved = 0
    for address, text in rows:
        if address and (not following or following < address):
            lines += ["PG", f"PG {address}"] if following else [f"PG {address}"]
            following = address
        moved += address not in (0, following)
        lines.append(text)
        statement = parsed(text, names) if address else None
        following += size_of(statement, personality) if statement is not None else 0
    if lines:
        lines.append("PG")
    return lines, [f"{moved} lines of its program have other addresses in the simulator"] if moved else []


def _remarked(snapshot: Snapshot) -> list[Row]:
    """The program with the remarks and the layout of its file; a line that the drive does not store has no address."""
    addresses, rows = dict(snapshot.program), []
    width = max((len(str(address)) for address in addresses), default=0)
    for line in snapshot.remarked:
        place, text = line[:width].strip(), line[width + 2 :]
        rows.append((int(place) if place.isdecimal() else 0, text))
    known = [address for address, _ in rows if address]
    return rows if known == list(addresses) else []


def _names(rows: Iterable[Row], variables: Iterable[str]) -> frozenset[str]:
    """The labels and variables of a program."""
    matches = (_NAMED.match(text) for _, text in rows)
    return frozenset((*variables, *(match[1].upper() for match in matches if match is not None)))


DEFAULT = 96
"""BD from the factory."""
ETHERNET = frozenset(name for name, model in MODELS.items() if model.ethernet)


class LockedPort(MCodePort):
    """The MCode/TCP port of a unit whose cyber security is on: it takes nothing and sends nothing."""

    def receive(self, data: bytes, now: float) -> None:
        """Drop the bytes; no bytes of the protection are public."""

    def sent(self, now: float) -> list[Transmission]:
        super().sent(now)
        return []


class LockedModbus(ModbusPort):
    """The same over Modbus/TCP."""

    def receive(self, data: bytes, now: float) -> bytes:
        return b""


def _shadow(device: MCodeDevice, port: MCodePort) -> Shadow:
    def rest() -> None:
        device.escape(0.0)
        port.receive(b"\n", 0.0)  # the line feed without which party mode is not in force (5.1.105)
        port.sent(0.0)

    def motion(now: float) -> tuple[Motion, ...]:
        return (device.motion(now),)

    def awaits(_: str, now: float) -> str | None:  # noqa: ARG001
        return "" if device.motor.homing_active else None

    return Shadow(rest, motion, device.align, awaits, lambda: {"": device.effort})


def _at_baud(spec: DriveSpec, baud: int) -> DriveSpec:
    """Set BD to the baud rate of the bus, where the cell file sets no other."""
    code = next((code for code, rate in BAUDS.items() if rate == baud), DEFAULT)
    if code == DEFAULT or "BD" in spec.set or spec.personality in ETHERNET:
        return spec
    return replace(spec, set={"BD": code, **spec.set})


class SimulatedLexium(SimulatedFamily):
    """Simulated Lexium drives and MDrivePlus."""

    name = "mcode"
    ethernet = ETHERNET

    @classmethod
    def read_drive(cls, table: Table, folder: Folder) -> DriveSpec:
        common = common_keys(table, folder)
        personality = common["personality"]
        name = table.text("name", "!")
        if not (len(name) == 1 and name.isascii() and (name.isalnum() or name == "!")):
            raise table.wrong("name", f"cannot be {quoted(name)}", "valid: one of a-z, A-Z, 0-9 or !")
        model, known = MODELS[personality], words(personality)
        counters = [
            "position",
            *(name for name in ("C1", "C2") if name in known and personality in known[name].products),
        ]
        world = table.table("world", "[bus.drive.world]")
        world.only(*WORLD_KEYS)
        settings, scales = read_settings(table.table("set", "set"), partial(_check, personality)), read_units(table)

        def valid(name: str) -> bool:
            return is_name(name) and lookup(name, personality) is None and len(name) <= model.longest_name

        return DriveSpec(
            **common,
            name=name,
            party=table.boolean("party", False),
            variables=read_variables(table, valid, "as in Q1"),
            identity=read_identity(table, ("part", "version", "serial"), dict.fromkeys(counters, 1)),
            set=settings,
            world=read_world(
                world, model.points.inputs, model.points.analog, _axis_scale(personality, settings, scales)
            ),
            units=scales,
        )

    @classmethod
    def build(cls, spec: DriveSpec, place: Place) -> Unit:
        """Build a drive that is powered up. Raises Diagnostic for settings that it refuses, and for a program."""
        world = World(spec.world)
        device = MCodeDevice(_at_baud(spec, place.baud), world)
        device.prints()  # no client can be connected at its sign-on
        model, ethernet = MODELS[spec.personality], spec.personality in ETHERNET
        kind, connection = (LockedPort, LockedModbus) if spec.cse else (MCodePort, ModbusPort)
        port = kind(device, serial=not ethernet, baud=0 if model.waits_to_print else place.baud)
        return Unit(
            device=device,
            port=port,
            worlds={"": world},
            shadow=_shadow(device, port),
            inputs=model.points.inputs,
            counts=model.points.analog,
            single_supply=model.single_supply,
            connect=(lambda: connection(device)) if ethernet else None,
        )

    @classmethod
    def describe(cls, snapshot: Snapshot) -> DriveText:
        personality = nearest(snapshot.product)
        readings = [reading for reading in snapshot.readings.readings if reading.name not in KEY_OF]
        users = [
            reading
            for reading in readings
            if reading.section == VARIABLES and lookup(reading.name, personality) is None
        ]
        variables = {value.name: value.value for value in users if isinstance(value.value, int)}
        model = MODELS[personality]
        lines, drift = _placed(_remarked(snapshot) or snapshot.program, personality, variables)
        remarks = [*snapshot.remarks, *drift]
        remarks += [
            f"not in set: {reading.name} = {reading.value} (the simulator does not take it)"
            for reading in readings
            if not (_acceptable(reading, personality) or _unset(reading, personality))
        ]
        if personality != snapshot.product:
            remarks.insert(
                0, f"the unit is an {snapshot.product}; the simulator knows none, and {personality} is the nearest"
            )
        texts = (("part", snapshot.part), ("version", snapshot.version), ("serial", snapshot.serial))
        identity = [CellEntry(key, plain(text)) for key, text in texts if text]
        identity += [CellEntry(key, count) for key, (count,) in snapshot.counters.items()]
        world: dict[str, object] = {}
        if snapshot.inputs:
            world["inputs"] = [[0.0, n, level] for n, level in snapshot.inputs]
        if snapshot.analog:
            world["analog"] = [[0.0, snapshot.analog[0]]]
        return DriveText(
            personality=personality,
            name=snapshot.name,
            party=snapshot.party,
            remarks=remarks,
            unread=snapshot.readings.unread,
            program=lines,
            settings=[*_settings([reading for reading in readings if reading.name not in variables], personality)],
            variables=[CellEntry(name, held) for name, held in variables.items()],
            identity=identity,
            worlds={"": world} if world else {},
            ethernet=model.ethernet,
            baud=snapshot.baud,
        )

    @classmethod
    def wanted(cls, spec: DriveSpec) -> dict[str, Value]:
        """Return the settings of a drive in a cell file. No line gives a drive the name !; FD does."""
        settings: dict[str, Value] = {**spec.variables}
        if not MODELS[spec.personality].ethernet:
            settings |= {"PY": int(spec.party)} if spec.name == UNNAMED else {"DN": spec.name, "PY": int(spec.party)}
        for name, held in spec.set.items():
            if name in LISTS:
                for row in held if isinstance(held, tuple) else (str(held),):
                    number, *fields = row.split(",")
                    settings[f"{name}{number.strip()}"] = tuple(map(_scalar, fields))
            elif isinstance(held, str) and "," in held:
                settings[name] = tuple(map(_scalar, held.split(",")))
            elif not isinstance(held, tuple):
                settings[name] = _scalar(held) if isinstance(held, str) else held
        return settings

    @classmethod
    def program(cls, spec: DriveSpec) -> StoredProgram:
        """The program of a drive in a cell file."""
        held = MCodeDevice(replace(spec, set={}, party=False), World(WorldSpec())).program
        rows = [(at, held.lines[at].text) for at in held.order]
        lines, _ = _placed(rows, spec.personality, spec.variables)
        names = _names(rows, spec.variables)
        return StoredProgram(
            lines=tuple(canonical(text, names) for _, text in rows),
            file=(*(f"VA {name}={value}" for name, value in spec.variables.items()), *lines),
            labels=tuple(held.labels),
        )
