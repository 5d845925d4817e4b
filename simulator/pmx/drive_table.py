"""The `[[bus.drive]]` table of a PMX in a cell file."""

from __future__ import annotations

from multidrop.simulator.cell.identities import read_identity, read_variables
from multidrop.simulator.cell.reader import common_keys
from multidrop.simulator.cell.settings import read_settings
from multidrop.simulator.cell.spec import DriveSpec, Value
from multidrop.simulator.cell.table import Folder, Table, quoted
from multidrop.simulator.cell.worlds import ENCODER_KEYS, KEYS, read_worlds
from multidrop.simulator.pmx.settings import AXES, VARIABLES

INPUTS, COUNTS = range(1, 9), 5000
"""Digital inputs, and the end of scale of the analog inputs in millivolts."""
NAMES = tuple(f"V{n}" for n in range(VARIABLES))
"""The variables of its programs."""


def read_drive(table: Table, folder: Folder) -> DriveSpec:
    """Read the table of one controller. Raises Diagnostic."""
    common = common_keys(table, folder)
    name = table.text("name", "00")
    if not (len(name) == 2 and name.isascii() and name.isdigit()):
        raise table.wrong("name", f"cannot be {quoted(name)}", "valid: two digits, 00 to 99")
    if table.boolean("party", False):
        raise table.wrong("party", "is for MCode drives", "leave it out: a PMX always has an address")
    world = table.table("world", "[bus.drive.world]")
    x, y = read_worlds(world, ("x", "y"), (*KEYS, *ENCODER_KEYS), INPUTS, COUNTS)
    settings = read_settings(table.table("set", "set"), _check_setting)
    variables = table.table("variables", "[bus.drive.variables]")
    identity = table.table("identity", "[bus.drive.identity]")
    return DriveSpec(
        **common,
        name=name,
        set=settings,
        variables=read_variables(variables, lambda name: name in NAMES, f"valid: {NAMES[0]} to {NAMES[-1]}"),
        identity=read_identity(identity, ("part", "version"), {"position": len(AXES), "encoder": len(AXES)}),
        world=x,
        further=(y,),
    )


def _check_setting(table: Table, word: str, value: Value) -> None:
    if not (word.isascii() and word.isalnum()):
        raise table.wrong(quoted(word), "is not a PMX command")
