"""A PMX as it was read, as the `[[bus.drive]]` table of a cell file; and that table as settings to write."""

from __future__ import annotations

from multidrop.dialects.files import split_lines
from multidrop.dialects.pmx.manual import program_file
from multidrop.dialects.pmx.manual.program_file import Undecodable
from multidrop.dialects.pmx.manual.script_compiler import ERASED
from multidrop.dialects.program_files import errors
from multidrop.dialects.values import VARIABLES, Snapshot, Value
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.cell.writer import DriveText, Entry, plain, remark
from multidrop.simulator.family import Snapshots, StoredProgram
from multidrop.simulator.pmx.commands import MODEL
from multidrop.simulator.pmx.drive_table import NAMES
from multidrop.simulator.pmx.settings import AXES

KEY_OF = ("DN",)
"""Words that have a key of their own."""


def describe(snapshot: Snapshot) -> DriveText:
    """Make the table of a controller."""
    readings = [each for each in snapshot.readings.readings if each.name not in KEY_OF]
    return DriveText(
        personality="PMX",
        name=snapshot.name,
        remarks=snapshot.remarks,
        unread=snapshot.readings.unread,
        program=_program(snapshot),
        settings=[Entry(each.name, each.value, remark(each)) for each in readings if each.section != VARIABLES],
        variables=[Entry(each.name, each.value) for each in readings if each.section == VARIABLES and each.value],
        identity=[
            *(
                Entry(key, plain(text))
                for key, text in (("part", snapshot.part), ("version", snapshot.version))
                if text
            ),
            *(Entry(key, list(counts)) for key, counts in snapshot.counters.items()),
        ],
        worlds=_worlds(snapshot),
        baud=snapshot.baud,
    )


def wanted(spec: DriveSpec) -> dict[str, Value]:
    """The settings of a controller in a cell file; a variable that is left out is 0."""
    settings = {name: held for name, held in spec.set.items() if not isinstance(held, tuple)}
    return {"DN": f"{MODEL}{spec.name}", **settings, **{name: spec.variables.get(name, 0) for name in NAMES}}


def program(spec: DriveSpec) -> StoredProgram:
    """The program of a controller in a cell file."""
    if not spec.program:
        return StoredProgram()
    return StoredProgram(
        tuple(program_file.memory(spec.program, spec.program_name)), tuple(split_lines(spec.program.strip()))
    )


def _program(snapshot: Snapshot) -> list[str]:
    """The program as its file, or as A-SCRIPT, where that gives the same memory; else as compiled lines."""
    tokens = [token for _, token in snapshot.program]
    for script in (list(snapshot.remarked), _script(snapshot)):
        text = "\n".join(script)
        if script and not errors(program_file.check(text)) and program_file.memory(text, "program") == tokens:
            return script
    return [f"SA{at}={token}" for at, token in snapshot.program if token != ERASED]


def _script(snapshot: Snapshot) -> list[str]:
    try:
        return program_file.readable([f"SA{at}={token}" for at, token in snapshot.program])
    except Undecodable:
        return []


def _worlds(snapshot: Snapshot) -> dict[str, dict[str, object]]:
    worlds: dict[str, dict[str, object]] = {axis.lower(): {} for axis in AXES}
    if snapshot.inputs:
        worlds["x"]["inputs"] = [[0.0, n, level] for n, level in snapshot.inputs]
    for axis, counts in zip(worlds, snapshot.analog, strict=False):
        worlds[axis]["analog"] = [[0.0, counts]]
    return {axis: keys for axis, keys in worlds.items() if keys}


SNAPSHOTS = Snapshots(describe, wanted, program)
