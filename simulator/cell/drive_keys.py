"""The keys of a `[[bus.drive]]` table that families share: program, settings, identity, variables and surroundings.

Every error is a `Diagnostic` of one line that names the key and its place.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.base.files import LARGEST_PROGRAM, bounded, program_of
from multidrop.dialects.units import STEP, Basis, Measure, Quantity, Scale, quantity, scale
from multidrop.simulator.cell.spec import Identity, Scalar, Value, WorldSpec
from multidrop.simulator.cell.table import Folder, Table, quoted

PROGRAM_TEXT = "program_text"
LONGEST_TEXT_VALUE = 60
"""Characters of a text of `identity`."""
INT32 = 2**31
Check = Callable[[Table, str, Value], None]
"""Refuses a word of `set`, or its value, that the product does not know. Raises Diagnostic."""
WORLD_KEYS = (
    "home",
    "limit_plus",
    "limit_minus",
    "stall_at",
    "load",
    "friction",
    "inertia",
    "inputs",
    "analog",
    "locked",
)
"""Keys of `world` for every drive."""
POSITIONS = ("home", "limit_plus", "limit_minus", "stall_at", "index")
"""Those that may have a unit."""
ENCODER_KEYS = ("index", "encoder", "slip")
"""Further keys for a drive with a separate encoder."""


def common_keys(table: Table, folder: Folder) -> dict[str, Any]:
    """Read the keys of a drive that mean the same in every family, as arguments of DriveSpec. Raises Diagnostic."""
    name = table.text("program", "")
    text = held = table.text(PROGRAM_TEXT, "")
    if name and held:
        raise table.wrong(PROGRAM_TEXT, "is given, and program too", "use one of them")
    if name:
        text = program_of(read_file(name, "program", table, folder, LARGEST_PROGRAM), name)[0]
    return {
        "personality": table.text("personality"),
        "program": text,
        "program_name": PROGRAM_TEXT if held else name,
        "instruction_us": table.number("instruction_us", 200.0, low=0.0, high=1e6),
        "cse": table.boolean("cse", False),
    }


def read_file(name: str, key: str, table: Table, folder: Folder, largest: int) -> bytes:
    """Read a file that a key names. Raises Diagnostic."""
    try:
        check_inside(Path(folder.real, name).resolve(), name, key, table, folder)
        file = folder.path.joinpath(name)
        if not file.is_file():
            raise table.wrong(key, f"{quoted(name)} does not exist", "paths are relative to the cell file")
        with file.open("rb") as stream:
            return bounded(stream, name, largest)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "not a path"
        raise table.wrong(key, f"{quoted(name)} cannot be read ({why})") from None


def check_inside(place: Path, name: str, key: str, table: Table, folder: Folder) -> None:
    """Refuse a path that leaves the folder of the cell file: the file may be another person's. Raises Diagnostic."""
    if not folder.holds(place):
        own = f"if the cell is your own: multidrop sim CELL --allow {shlex.quote(str(place))}"
        hint = f"use a path inside it; {own}, or simulator.allow in the configuration"
        raise table.wrong(key, f"{quoted(name)} leaves the folder of the cell file", hint)


def read_settings(table: Table, check: Check, spelled: Callable[[str], str] = str.upper) -> Mapping[str, Value]:
    """Read `set`, what non-volatile memory holds, with its words as they are `spelled` in the drive.

    A list of texts, or of lists of numbers, gives several lines.
    """
    settings: dict[str, Value] = {}
    for word, value in table.values.items():
        name = spelled(word)
        if name in settings:
            raise table.wrong(quoted(word), "is given twice")
        if not isinstance(value, list):
            settings[name] = _scalar(table, word, value)
        elif not value:
            raise _wrong_shape(table, word)
        else:
            rows = (row if isinstance(row, list) else [row] for row in value)
            settings[name] = tuple(",".join(str(_scalar(table, word, each)) for each in row) for row in rows)
        check(table, word, settings[name])
    return MappingProxyType(settings)


def _scalar(table: Table, word: str, value: Any) -> Scalar:
    """Read a value that fits into a line to a drive; true is 1, false is 0."""
    if isinstance(value, str) and value.isascii() and value.isprintable():
        return value
    if isinstance(value, (int, float)) and abs(value) < 2.0**63:
        return int(value) if isinstance(value, bool) else value
    raise _wrong_shape(table, word)


def _wrong_shape(table: Table, word: str) -> Diagnostic:
    return table.wrong(quoted(word), "must be a number or text", 'several lines: IS = ["1,1,0", "2,2,0"]')


def read_identity(drive: Table, texts: Collection[str], counters: Mapping[str, int]) -> Identity:
    """Read `identity`. `texts`: the valid ones of part, version and serial; `counters`: their axes, by key."""
    table = drive.table("identity", "[bus.drive.identity]")
    table.only(*texts, *counters)
    given: dict[str, str] = {}
    for key in texts:
        given[key] = value = table.text(key, "")
        if len(value) > LONGEST_TEXT_VALUE or not (value.isascii() and value.isprintable()):
            raise table.wrong(
                key, f"cannot be {quoted(value)}", f"valid: up to {LONGEST_TEXT_VALUE} printable ASCII characters"
            )
    counts = {key: _counts(table, key, counters[key]) for key in counters if key in table.values}
    return Identity(**given, counters=MappingProxyType(counts))


def _counts(table: Table, key: str, axes: int) -> tuple[int, ...]:
    """Read one whole number, or a list with one for each axis."""
    if axes == 1:
        return (table.integer(key, 0, -INT32, INT32 - 1),)
    rows = table.values[key]
    if not isinstance(rows, list) or len(rows) != axes:
        raise table.wrong(key, f"must be a list of {axes} whole numbers, one for each axis")
    return tuple(Table({key: row}, table.where).integer(key, 0, -INT32, INT32 - 1) for row in rows)


def read_variables(drive: Table, valid: Callable[[str], bool], hint: str) -> Mapping[str, int]:
    """Read `variables`: whole numbers by name."""
    table = drive.table("variables", "[bus.drive.variables]")
    variables: dict[str, int] = {}
    for word in table.values:
        name = word.upper()
        if not valid(name):
            raise table.wrong(quoted(word), "is not the name of a variable", hint)
        if name in variables:
            raise table.wrong(quoted(word), "is given twice")
        variables[name] = table.integer(word, 0, -INT32, INT32 - 1)
    return MappingProxyType(variables)


def read_units(table: Table, axes: Sequence[str] = ("",)) -> Mapping[str, Scale]:
    """Read `units`: the scale of the first axis, or a table with those of several, by axis."""
    given = table.values.get("units")
    by_axis = given if isinstance(given, dict) and "scale" not in given else {axes[0]: given}
    scales: dict[str, Scale] = {}
    for axis, keys_of_axis in by_axis.items() if given is not None else ():
        if axis not in axes:
            hint = f"valid: {', '.join(axes)}" if axes[0] else 'as in units = "5 mm/turn"'
            raise Diagnostic(f"units: no axis {quoted(axis)}", table.at_line("units"), hint)
        try:
            scales[axis] = scale(keys_of_axis, table.source.own_units)
        except Diagnostic as problem:
            raise Diagnostic(f"units: {problem.message}", table.at_line("units"), problem.hint) from None
    return MappingProxyType(scales)


@dataclass(frozen=True)
class AxisScale:
    """The scale of an axis, and the motor steps of the world in a turn of its motor and in one count of its drive.

    `turn` None: nothing tells, for the reason `missing`.
    """

    scale: Scale | None
    turn: Fraction | None
    count: Fraction
    missing: str = ""


UNSCALED = AxisScale(None, None, Fraction(1))


def _in_steps(table: Table, axis: AxisScale) -> Table:
    """Convert positions with a unit (`"301 mm"`) to motor steps from the world's origin, by the scale without zero."""
    values, given = dict(table.values), axis.scale
    for key in POSITIONS:
        several = isinstance(values.get(key), list)
        places = values[key] if several else [values.get(key)]
        if not any(isinstance(place, str) for place in places):
            continue
        try:
            own = table.source.own_units
            read = [quantity(place, own) if isinstance(place, str) else place for place in places]
            if given is None:
                raise Diagnostic("the drive has no scale", "", 'add units = "5 mm/turn" to its table')
            by_step = replace(given, value=given.value / axis.count) if given.of == STEP else given
            measure = Measure(by_step, Basis(turn=axis.turn, missing=axis.missing))
            steps = [measure.steps(value) if isinstance(value, Quantity) else value for value in read]
        except Diagnostic as problem:
            raise Diagnostic(f"{key}: {problem.message}", table.at_line(key), problem.hint) from None
        if several and given.value < 0 and all(isinstance(place, str) for place in places):
            steps.reverse()
        values[key] = steps if several else steps[0]
    return replace(table, values=values)


def read_world(table: Table, inputs: Sequence[int], counts: int, axis: AxisScale = UNSCALED) -> WorldSpec:
    """Read the surroundings of one axis of a drive with these inputs and an analog input up to `counts`."""
    table = _in_steps(table, axis)
    changes = table.rows("inputs", (("seconds", 0, 1e9), ("input", min(inputs), max(inputs)), ("level", 0, 1)))
    for _, n, _ in changes:
        if n not in inputs:
            raise table.wrong("inputs", f"has no input {n:g}", f"valid: {', '.join(map(str, sorted(inputs)))}")
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
        friction=table.number("friction", 0.0, low=0.0, high=1000.0),
        inertia=table.number("inertia", 0.0, low=0.0, high=1000.0),
    )


def read_worlds(
    table: Table,
    axes: Sequence[str],
    keys: Sequence[str],
    inputs: Sequence[int],
    counts: int,
    scales: Mapping[str, AxisScale] = MappingProxyType({}),
) -> tuple[WorldSpec, ...]:
    """Read the surroundings of each axis from a table of its own; keys without an axis belong to the first axis."""
    table.only(*keys, *axes)
    parts = [table.table(axis, f"[bus.drive.world.{axis}]") for axis in axes]
    for part in parts:
        part.only(*keys)
    first = parts[0]
    for key in keys:
        if key in first.values and key in table.values:
            raise first.wrong(key, "is given twice", f"keys without an axis belong to {axes[0]}")
    both = table.merged(first)
    pairs = zip((both, *parts[1:]), axes, strict=True)
    return tuple(read_world(part, inputs, counts, scales.get(axis, UNSCALED)) for part, axis in pairs)
