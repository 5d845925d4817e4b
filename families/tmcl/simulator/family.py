"""The family of the TMCL modules: built from a cell file's `[[bus.drive]]` table, which is read and written here.

`set` has parameters in EEPROM by number: `4 = 51200` is an axis parameter, `4_1` that of motor 1, `G75 = 5` a global
one of bank 0; `variables` has user variables of bank 2 by number. A module as it was read from a unit becomes such a
table, and a table the settings to write to a unit.

Its serial port takes nine bytes and sends nine bytes. A request for another address gets no reply. Framing is by count;
the module drops an unfinished message after a pause. Ruling: the pause is 0.5 s; the manuals give none.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import partial
from struct import Struct

from multidrop.base.files import SourceLine, split_lines
from multidrop.dialects.family import Motion
from multidrop.dialects.program_files import errors
from multidrop.dialects.units import Scale
from multidrop.dialects.values import Snapshot, Value
from multidrop.families.tmcl.manual import program_file
from multidrop.families.tmcl.manual.commands import AxisParameter, Command, Global, Status, TmclCall, setting_name
from multidrop.families.tmcl.manual.instructions import spelled
from multidrop.families.tmcl.manual.modules import (
    BAUDS,
    GLOBAL,
    MODULES,
    PREFIX,
    USERS,
    Module,
    module_of,
)
from multidrop.families.tmcl.manual.parameters import TmclParameter
from multidrop.families.tmcl.simulator.module import TmclModule, storable, worlds_of
from multidrop.families.tmcl.simulator.motor import FULL
from multidrop.simulator.cell.drive_keys import (
    WORLD_KEYS,
    AxisScale,
    common_keys,
    read_identity,
    read_settings,
    read_units,
    read_variables,
    read_worlds,
)
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.cell.spec import Value as Setting
from multidrop.simulator.cell.table import Folder, Table, quoted
from multidrop.simulator.cell.writer import CellEntry, DriveText, remark
from multidrop.simulator.family import Effort, Place, Shadow, SimulatedFamily, StoredProgram, Unit
from multidrop.simulator.wire import Port, Transmission

VERSION_FORM = re.compile(r"\d{4}V\d{3}", re.ASCII)
GLOBAL_PREFIX = "G"
ANALOG_FULL_SCALE = 4095
"""The end of scale of an analog input."""
VARIABLES = tuple(map(str, USERS))
FULL_STEPS = 200
"""Of a motor of 1.8 degrees, where the cell file says nothing else."""


def _axis_scale(module: Module, settings: Mapping[str, Setting], name: str, scale: Scale | None) -> AxisScale:
    """A count is a microstep. A step of the world is 1/256 of a full step."""
    word = f"{int(AxisParameter.MICROSTEPS)}"
    power = settings.get(word if name == "0" else f"{word}_{name}", module.axis[AxisParameter.MICROSTEPS].fresh)
    full_steps = (scale.full_steps if scale is not None else None) or FULL_STEPS
    return AxisScale(scale, Fraction(full_steps * FULL), Fraction(FULL, 2 ** int(str(power))))


def _canonical(personality: str) -> str:
    """One name for the 1241, which has two."""
    return PREFIX if module_of(personality) is module_of(PREFIX) else personality


def _names(module: Module) -> tuple[str, ...]:
    """The names of a module's motors in `world`, and for `/sim`."""
    return tuple(map(str, range(module.motors)))


def inputs_of(module: Module) -> tuple[int, ...]:
    """The inputs of a module in its world: its ports from 1."""
    return tuple(port + 1 for port in module.inputs)


def _check_setting(module: Module, table: Table, word: str, value: Setting) -> None:
    row = _parameter(module, setting_name(word))
    if row is None:
        hint = (
            "valid: axis parameters by number, such as 4 = 51200 (4_1: motor 1); global ones with a G, such as G75 = 5"
        )
        raise table.wrong(quoted(word), "is not a parameter in EEPROM", hint)
    if not isinstance(value, int) or value not in row.limits:
        raise table.wrong(quoted(word), f"cannot be {value}", f"valid: {row.valid}")


NAME = re.compile(r"(G?)(0|[1-9]\d{0,2})(?:_([1-9]))?", re.ASCII)


def _parameter(module: Module, word: str) -> TmclParameter | None:
    """The parameter that a key names, of those that EEPROM holds; the address has a key of its own."""
    match = NAME.fullmatch(word)
    if match is None or int(match[3] or 0) >= (1 if match[1] else module.motors):
        return None
    number = int(match[2])
    if match[1]:
        row = module.banks[0].get(number)
        return row if row is not None and row.writable and number != Global.ADDRESS else None
    row = module.axis.get(number)
    return row if row is not None and storable(number, row) else None


ADDRESS = f"{GLOBAL_PREFIX}{int(Global.ADDRESS)}"
"""The parameter that has a key of its own."""
BAUD = f"{GLOBAL_PREFIX}{int(Global.BAUD)}"


def _program(snapshot: Snapshot) -> list[str]:
    """The program as its file where that gives the same memory, else with labels that the host has made."""
    held = dict(snapshot.program)
    if snapshot.remarked and not errors(program_file.check("\n".join(snapshot.remarked))):
        return list(snapshot.remarked)
    made = program_file.assembled([SourceLine(number, text) for number, text in enumerate(held.values(), 1)])
    return program_file.disassembled(dict(zip(held, (line.call for line in made.lines), strict=True)))


LENGTH = 9
FRAME_TIMEOUT = 0.5
"""Seconds of silence after which an unfinished message is dropped."""
REQUEST = Struct(">BBBBi")
REPLY = Struct(">BBBBi")


class TmclPort(Port):
    """The serial port of one module. `any_baud`: the wire has no baud rate that the module can be set to."""

    def __init__(self, device: TmclModule, *, any_baud: bool = True) -> None:
        self._device = device
        self._any_baud = any_baud
        self._message = bytearray()
        self._heard_at = 0.0
        self._out: list[Transmission] = []

    @property
    def baud(self) -> int:
        return 0 if self._any_baud else BAUDS.get(self._device[Global.BAUD], 0)

    @property
    def deadline(self) -> float | None:
        times = (self._device.deadline, *(transmission.at for transmission in self._out))
        return min((at for at in times if at is not None), default=None)

    def receive(self, data: bytes, now: float) -> None:
        if not self._device.powered:
            self._message.clear()
            return
        if now - self._heard_at > FRAME_TIMEOUT:
            self._message.clear()
        self._heard_at = now
        for byte in data:
            self._message.append(byte)
            if len(self._message) == LENGTH:
                message = bytes(self._message)
                self._message.clear()
                self._take(message, now)

    def sent(self, now: float) -> list[Transmission]:
        self._device.advance(now)
        for at, motors in self._device.notices():
            self._say(at, self._frame(Status.TARGET_REACHED, Command.NOTIFY, motors))
        due = [transmission for transmission in self._out if transmission.at <= now]
        self._out = [transmission for transmission in self._out if transmission.at > now]
        return due

    def _take(self, message: bytes, now: float) -> None:
        address, command, kind, motor, value = REQUEST.unpack(message[:-1])
        own = self._device[Global.ADDRESS]
        if address != own and not self._device.any_address:
            return
        self._device.advance(now)
        host = self._device[Global.HOST_ADDRESS]
        if sum(message[:-1]) % 256 != message[-1]:
            self._say(now, self._frame(Status.WRONG_CHECKSUM, command, 0))
            return
        answer = self._device.execute(TmclCall(command, kind, motor, value), now)
        if answer is None:
            return
        if answer.text:
            self._say(now, bytes([host]) + answer.text.encode("ascii"))
        elif answer.line is not None:
            line = answer.line
            self._say(now, self._frame(line.type, line.motor, line.value, line.command, host))
        else:
            self._say(now, self._frame(answer.status, command, answer.value, own, host))

    def _frame(
        self, status: int, command: int, value: int, address: int | None = None, host: int | None = None
    ) -> bytes:
        """One reply; it names the address that the module had when the request came."""
        host = self._device[Global.HOST_ADDRESS] if host is None else host
        address = self._device[Global.ADDRESS] if address is None else address
        body = REPLY.pack(host, address, status, command, value)
        return body + bytes([sum(body) % 256])

    def _say(self, at: float, data: bytes) -> None:
        self._out.append(Transmission(at + self._device[Global.PAUSE] / 1000, data))


def _shadow(device: TmclModule, names: Sequence[str]) -> Shadow:
    motors = dict(zip(names, device.motors, strict=True))

    def motion(now: float) -> tuple[Motion, ...]:
        return tuple(
            Motion(motor.read(AxisParameter.ACTUAL_POSITION, now), motor.read(AxisParameter.ACTUAL_VELOCITY, now), name)
            for name, motor in motors.items()
        )

    def efforts() -> dict[str, Effort]:
        return {name: motor.effort for name, motor in motors.items()}

    def align(name: str, position: int, now: float) -> None:
        motors[name].end_search()
        motors[name].put(position, now)

    def awaits(name: str, now: float) -> str | None:  # noqa: ARG001
        search = motors[name].search
        return None if search is None else search.awaited

    shafts = {name: motor.shaft for name, motor in motors.items()}
    return Shadow(device.unwatch, motion, align, awaits, efforts, shafts)


class SimulatedTmcl(SimulatedFamily):
    """Simulated TMCL modules."""

    name = "tmcl"
    addressed = True
    keys = ("any_address",)

    @classmethod
    def read_drive(cls, table: Table, folder: Folder) -> DriveSpec:
        common = common_keys(table, folder)
        if wrong := errors(program_file.check(common["program"])):
            raise table.wrong("program", f"has an error in line {wrong[0].line}: {wrong[0].what}", wrong[0].hint)
        name = table.text("name", "1")
        if not (
            name.isascii() and name.isdigit() and str(int(name)) == name and int(name) in GLOBAL[Global.ADDRESS].limits
        ):
            raise table.wrong("name", f"cannot be {quoted(name)}", "valid: the address of a module, 1 to 255")
        if table.boolean("party", False):
            raise table.wrong("party", "is for MCode drives", "leave it out: a module always has an address")
        common["personality"] = _canonical(common["personality"])
        module = module_of(common["personality"])
        settings = read_settings(table.table("set", "set"), partial(_check_setting, module), setting_name)
        names = _names(module)
        scales = read_units(table, names if module.motors > 1 else ("",))
        geared = {
            name: _axis_scale(module, settings, name, scales.get(name if module.motors > 1 else "")) for name in names
        }
        surroundings = table.table("world", "[bus.drive.world]")
        world, *further = read_worlds(surroundings, names, WORLD_KEYS, inputs_of(module), ANALOG_FULL_SCALE, geared)
        identity = read_identity(table, ("version",), {"position": module.motors, "target": module.motors})
        if identity.version and not VERSION_FORM.fullmatch(identity.version):
            hint = "valid: module and firmware, as in 1241V115"
            rows = table.table("identity", "[bus.drive.identity]")
            raise rows.wrong("version", f"cannot be {quoted(identity.version)}", hint)
        return DriveSpec(
            **common,
            name=name,
            set=settings,
            variables=read_variables(
                table, lambda name: name in VARIABLES, "valid: user variables by number, 0 to 255"
            ),
            identity=identity,
            world=world,
            further=tuple(further),
            any_address=table.boolean("any_address", False),
            units=scales,
        )

    @classmethod
    def build(cls, spec: DriveSpec, place: Place) -> Unit:
        worlds = worlds_of(spec)
        device = TmclModule(spec, worlds, place.baud)
        names = _names(device.table) if len(worlds) > 1 else ("",)
        return Unit(
            device=device,
            port=TmclPort(device, any_baud=place.baud not in BAUDS.values()),
            worlds=dict(zip(names, worlds, strict=True)),
            inputs=inputs_of(device.table),
            counts=ANALOG_FULL_SCALE,
            shadow=_shadow(device, names),
            single_supply=True,
        )

    @classmethod
    def describe(cls, snapshot: Snapshot) -> DriveText:
        personality = _canonical(snapshot.product if snapshot.product.removeprefix(f"{PREFIX}-") in MODULES else PREFIX)
        module = module_of(personality)
        readings = [reading for reading in snapshot.readings.readings if reading.name != ADDRESS]
        held = [reading for reading in readings if _parameter(module, reading.name) is not None]
        counters = {key: counts[: module.motors] for key, counts in snapshot.counters.items()}
        return DriveText(
            personality=personality,
            name=snapshot.name,
            remarks=[
                *snapshot.remarks,
                *(f"not in set: {reading.name} = {reading.value}" for reading in readings if reading not in held),
            ],
            unread=snapshot.readings.unread,
            program=_program(snapshot),
            settings=[CellEntry(reading.name, reading.value, remark(reading)) for reading in held],
            identity=[
                *([CellEntry("version", snapshot.version)] if snapshot.version else []),
                *(CellEntry(key, list(counts) if module.motors > 1 else counts[0]) for key, counts in counters.items()),
            ],
            baud=snapshot.baud,
        )

    @classmethod
    def wanted(cls, spec: DriveSpec) -> dict[str, Value]:
        """The settings of a module in a cell file, but not its baud rate, which would cut the line off at once."""
        settings = {name: held for name, held in spec.set.items() if not isinstance(held, tuple) and name != BAUD}
        return {ADDRESS: int(spec.name), **settings}

    @classmethod
    def program(cls, spec: DriveSpec) -> StoredProgram:
        """The program of a module in a cell file: each line as the module lists it, and the lines of its file."""
        if not spec.program:
            return StoredProgram()
        lines = program_file.compiled(program_file.read(spec.program, spec.program_name))
        listed = tuple(f"{line.at}  {spelled(line.call)}" for line in lines)
        return StoredProgram(listed, tuple(split_lines(spec.program.strip("\n"))))
