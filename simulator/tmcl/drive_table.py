"""The `[[bus.drive]]` table of a TMCL module in a cell file.

`set` has parameters in EEPROM by number: `4 = 51200` is an axis parameter, `G75 = 5` a global one of bank 0.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from multidrop.dialects.tmcl.manual.commands import AXIS, GLOBAL, Global, Parameter
from multidrop.simulator.cell.identities import read_identity
from multidrop.simulator.cell.reader import common_keys
from multidrop.simulator.cell.settings import read_settings
from multidrop.simulator.cell.spec import DriveSpec, Identity, Value
from multidrop.simulator.cell.table import Folder, Table, quoted
from multidrop.simulator.cell.worlds import read_world
from multidrop.simulator.tmcl.motor import STORED

VERSION = re.compile(r"\d{4}V\d{3}", re.ASCII)
GLOBAL_PREFIX = "G"
WORLD_KEYS = ("home", "limit_plus", "limit_minus", "stall_at", "load", "locked")
NO_INPUTS = (1,)
"""A range that `read_world` needs and no key uses: the module has no inputs but its switches."""


def read_drive(table: Table, folder: Folder) -> DriveSpec:
    """Read the table of one module. Raises Diagnostic."""
    common = common_keys(table, folder)
    if common["program"]:
        raise table.wrong("program", "is for other drives", "leave it out: direct mode runs no program")
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
    identity = table.table("identity", "[bus.drive.identity]")
    return DriveSpec(
        **common,
        name=name,
        set=settings,
        identity=_identity(identity),
        world=read_world(world, NO_INPUTS, 0),
    )


def _identity(table: Table) -> Identity:
    found = read_identity(table, ("version",), {"position": 1})
    if found.version and not VERSION.fullmatch(found.version):
        raise table.wrong("version", f"cannot be {quoted(found.version)}", "valid: module and firmware, as in 1241V115")
    return found


def split_settings(settings: Mapping[str, Value]) -> tuple[dict[int, int], dict[int, int]]:
    """Divide checked settings into axis parameters and global parameters, by number."""
    axis = {int(name): int(value) for name, value in settings.items() if name.isdigit()}  # type: ignore[arg-type]
    module = {int(name[1:]): int(value) for name, value in settings.items() if not name.isdigit()}  # type: ignore[arg-type]
    return axis, module


def stored(word: str) -> bool:
    """Whether EEPROM holds the parameter of a key."""
    return _parameter(word) is not None


def _check_setting(table: Table, word: str, value: Value) -> None:
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
