"""The family of the TMCL modules: built from a cell file's `[[bus.drive]]` table, which is read and written here.

`set` has parameters in EEPROM by number: `4 = 51200` is an axis parameter, `G75 = 5` a global one of bank 0. A module
as it was read from a unit becomes such a table, and a table the settings to write to a unit.
"""

from __future__ import annotations

import re

from multidrop.dialects.family import Motion
from multidrop.dialects.files import split_lines
from multidrop.dialects.program_files import errors
from multidrop.dialects.tmcl.manual import program_file
from multidrop.dialects.tmcl.manual.commands import AXIS, BAUDS, GLOBAL, Axis, Global, Parameter
from multidrop.dialects.tmcl.manual.instructions import spelled
from multidrop.dialects.tmcl.manual.program_file import ProgramLine
from multidrop.dialects.values import Snapshot, Value
from multidrop.simulator.cell.drive_keys import common_keys, read_identity, read_settings, read_world
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.cell.spec import Value as Setting
from multidrop.simulator.cell.table import Folder, Table, quoted
from multidrop.simulator.cell.writer import DriveText, Entry, remark
from multidrop.simulator.family import Family, Place, Shadow, Snapshots, StoredProgram, Unit
from multidrop.simulator.tmcl.module import TmclModule, TmclPort
from multidrop.simulator.tmcl.motor import STORED
from multidrop.simulator.world import World

VERSION_FORM = re.compile(r"\d{4}V\d{3}", re.ASCII)
GLOBAL_PREFIX = "G"
WORLD_KEYS = ("home", "limit_plus", "limit_minus", "stall_at", "load", "locked")
NO_INPUTS = (1,)
"""A range that `read_world` needs and no key uses: the module has no inputs but its switches."""


def read_drive(table: Table, folder: Folder) -> DriveSpec:
    """Read the table of one module. Raises Diagnostic."""
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
    world = table.table("world", "[bus.drive.world]")
    world.only(*WORLD_KEYS)
    settings = read_settings(table.table("set", "set"), _check_setting)
    if table.table("variables", "[bus.drive.variables]").values:
        raise table.wrong("variables", "is for other drives", "leave it out: direct mode has none")
    rows = table.table("identity", "[bus.drive.identity]")
    identity = read_identity(rows, ("version",), {"position": 1})
    if identity.version and not VERSION_FORM.fullmatch(identity.version):
        hint = "valid: module and firmware, as in 1241V115"
        raise rows.wrong("version", f"cannot be {quoted(identity.version)}", hint)
    return DriveSpec(
        **common,
        name=name,
        set=settings,
        identity=identity,
        world=read_world(world, NO_INPUTS, 0),
    )


def _check_setting(table: Table, word: str, value: Setting) -> None:
    row = _parameter(word.upper())
    if row is None:
        hint = "valid: axis parameters by number, such as 4 = 51200; global ones with a G, such as G75 = 5"
        raise table.wrong(quoted(word), "is not a parameter in EEPROM", hint)
    if not isinstance(value, int) or value not in row.limits:
        raise table.wrong(quoted(word), f"cannot be {value}", f"valid: {row.limits[0]} to {row.limits[-1]}")


def _parameter(word: str) -> Parameter | None:
    """The parameter that a key names, of those that EEPROM holds; the address has a key of its own."""
    number = word.removeprefix(GLOBAL_PREFIX)
    if not (number.isascii() and number.isdigit() and len(number) < 4 and str(int(number)) == number):
        return None
    if word.startswith(GLOBAL_PREFIX):
        return GLOBAL.get(int(number)) if int(number) not in (Global.ADDRESS, Global.PROGRAM_STATUS) else None
    return AXIS[int(number)] if int(number) in STORED else None


ADDRESS = f"{GLOBAL_PREFIX}{int(Global.ADDRESS)}"
"""The parameter that has a key of its own."""
BAUD = f"{GLOBAL_PREFIX}{int(Global.BAUD)}"


def describe(snapshot: Snapshot) -> DriveText:
    readings = [each for each in snapshot.readings.readings if each.name != ADDRESS]
    return DriveText(
        personality="TMCM",
        name=snapshot.name,
        remarks=[
            *snapshot.remarks,
            *(f"not in set: {each.name} = {each.value}" for each in readings if _parameter(each.name) is None),
        ],
        unread=snapshot.readings.unread,
        program=_program(snapshot),
        settings=[Entry(each.name, each.value, remark(each)) for each in readings if _parameter(each.name) is not None],
        identity=[
            *([Entry("version", snapshot.version)] if snapshot.version else []),
            *(Entry(key, counts[0]) for key, counts in snapshot.counters.items()),
        ],
        baud=snapshot.baud,
    )


def wanted(spec: DriveSpec) -> dict[str, Value]:
    """The settings of a module in a cell file, but not its baud rate, which would cut the line off at once."""
    settings = {name: held for name, held in spec.set.items() if not isinstance(held, tuple) and name != BAUD}
    return {ADDRESS: int(spec.name), **settings}


def program(spec: DriveSpec) -> StoredProgram:
    """The program of a module in a cell file: each line as the module lists it, and the lines of its file."""
    if not spec.program:
        return StoredProgram()
    lines = program_file.compiled(program_file.read(spec.program, spec.program_name))
    listed = tuple(f"{each.at}  {spelled(each.call)}" for each in lines)
    return StoredProgram(listed, tuple(split_lines(spec.program.strip("\n"))))


def _program(snapshot: Snapshot) -> list[str]:
    """The program as its file where that gives the same memory, else with labels that the host has made."""
    held = dict(snapshot.program)
    if snapshot.remarked and not errors(program_file.check("\n".join(snapshot.remarked))):
        return list(snapshot.remarked)
    made = program_file.assembled([ProgramLine(number, text) for number, text in enumerate(held.values(), 1)])
    return program_file.disassembled(dict(zip(held, (each.call for each in made.lines), strict=True)))


def build(spec: DriveSpec, place: Place) -> Unit:
    world = World(spec.world)
    device = TmclModule(spec, world, place.baud)
    port = TmclPort(device, any_baud=place.baud not in BAUDS.values())
    return Unit(device=device, port=port, worlds={"": world}, shadow=_shadow(device), single_supply=True)


def _shadow(device: TmclModule) -> Shadow:
    motor = device.motor

    def motion(now: float) -> tuple[Motion, ...]:
        return (Motion(motor.read(Axis.ACTUAL_POSITION, now), motor.read(Axis.ACTUAL_VELOCITY, now)),)

    return Shadow(lambda: None, motion, lambda _, position, now: motor.stand_at(position, now))


TMCL = Family(
    name="tmcl",
    read_drive=read_drive,
    build=build,
    snapshots=Snapshots(describe, wanted, program),
    addressed=True,
)
