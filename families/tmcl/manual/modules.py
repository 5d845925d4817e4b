"""The parameters of TMCL modules, with the numbers that the maker's library lists for each module.

`parameters.csv` has the axis parameters, those that modules which count in units of their chip have otherwise (`chip`),
and the global ones of bank 0. `valid` is `-` for a parameter that is only read, and `?` for a range that is not public:
any value of 32 bits is taken. Every cell says something. `modules.csv` has
the modules. Positions are microsteps. Velocities and accelerations are microsteps/s and microsteps/s2 on modules with a
TMC5130, TMC5160 or TMC4361; those with a TMC428 or TMC429 count in units of that chip. (TMCL firmware manuals, "Axis
parameters", "Global parameters".)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from multidrop.base.files import rows
from multidrop.families.tmcl.manual.commands import INT32, Axis, Status

MIRRORED, INVERTED = 64, 128
"""Added to a mode of the reference search: the right switch in place of the left one; the home switch inverted."""


@dataclass(frozen=True)
class Parameter:
    """One parameter. `limits`: the values that can be set, in order; empty for one that is only read."""

    title: str
    limits: Sequence[int] = range(0)
    unit: str = ""
    fresh: int = 0
    live: bool = False
    """It shows a state of the moment: it is no setting, and nothing restores it."""
    known: bool = True
    """More than its number and its name is public."""

    @property
    def writable(self) -> bool:
        return len(self.limits) > 0

    @property
    def valid(self) -> str:
        """The values that can be set, in words."""
        if not self.known:
            return "range not known"
        if isinstance(self.limits, range):
            return f"{self.limits[0]} to {self.limits[-1]}"
        ends = [n for n in self.limits if n - 1 not in self.limits or n + 1 not in self.limits]
        return ", ".join(f"{low} to {high}" for low, high in zip(ends[::2], ends[1::2], strict=True))


def _limits(text: str) -> Sequence[int]:
    ends = (part.split("..") for part in text.split())
    ranges = [range(int(low), int(high) + 1) for low, high in ends]
    return ranges[0] if len(ranges) == 1 else tuple(n for each in ranges for n in each)


def record(row: Mapping[str, str]) -> Parameter:
    """Make the record of a row. Raises ValueError for a wrong cell."""
    if empty := [column for column, text in row.items() if not text]:
        raise ValueError(f"the row of {row['group']} {row['number']} says nothing of: {', '.join(empty)}")
    return Parameter(
        title=row["title"],
        limits=INT32 if row["valid"] == "?" else _limits(row["valid"]) if row["valid"] != "-" else range(0),
        unit="" if row["unit"] == "-" else row["unit"],
        fresh=int(row["fresh"]),
        live={"yes": True, "no": False}[row["live"]],
        known=row["valid"] != "?",
    )


def _groups() -> Mapping[str, Mapping[int, Parameter]]:
    found: dict[str, dict[int, Parameter]] = {}
    for row in rows(__file__, "parameters.csv"):
        found.setdefault(row["group"], {})[int(row["number"])] = record(row)
    return found


GROUPS = _groups()
"""The parameters by group and number: `axis`, `chip`, `global`, and the name of a module for those that only it has."""
_AXIS, _CHIP, _GLOBAL = GROUPS["axis"], GROUPS["chip"], GROUPS["global"]
GLOBAL: Mapping[int, Parameter] = {number: row for number, row in _GLOBAL.items() if row.known}
RELATIVE_FROM: Mapping[int, str] = {
    0: "counts from the last target",
    1: "counts from here",
    2: "counts from the encoder's position",
}
"""The values of axis parameter 127; only some modules have it, those that count in microsteps."""
USER = Parameter("user variable; STGP keeps it without power", INT32)
USERS = range(256)
"""The numbers of the user variables, in bank 2."""
BAUDS: Mapping[int, int] = {0: 9600, 1: 14400, 2: 19200, 3: 28800, 4: 38400, 5: 57600, 6: 76800, 7: 115200}
"""Baud rates by the code in global parameter 65. The codes beyond 9600 are common knowledge, read in no manual."""


def _interrupt(number: int) -> str:
    """The name of a parameter of bank 3: timers, stop switches of motors, inputs."""
    if number < 27:
        return f"interrupt: timer {number}"
    motor, right = divmod(number - 27, 2)
    return (
        f"interrupt: input {number - 39}" if number > 38 else f"interrupt: {'right' if right else 'left'} stop {motor}"
    )


@dataclass(frozen=True)
class Module:
    """One module. `banks` are its global parameters; ports of `inputs`, `analog` and `outputs` are as GIO and SIO take.

    `wrong_motor`: its status for a motor that it lacks. `chip_units`: it counts in units of its chip.
    """

    version: str
    axis: Mapping[int, Parameter]
    banks: Mapping[int, Mapping[int, Parameter]]
    motors: int = 1
    inputs: Sequence[int] = ()
    outputs: Sequence[int] = ()
    analog: Sequence[int] = ()
    chip_units: bool = False
    wrong_motor: Status = Status.WRONG_TYPE


def _numbers(text: str) -> Iterator[int]:
    for part in text.split():
        first, _, last = part.partition("-")
        yield from range(int(first), int(last or first) + 1)


VOLTAGE, TEMPERATURE = 8, 9
"""Analog ports of every module: its supply voltage and its temperature."""


def _module(row: Mapping[str, str]) -> Module:
    chip_units = row["units"] == "chip"
    axis = {**_AXIS, **(_CHIP if chip_units else {}), **GROUPS.get(row["module"], {})}
    return Module(
        row["version"],
        {number: axis[number] for number in _numbers(row["axis"])},
        {
            0: {number: _GLOBAL[number] for number in _numbers(row["global"])},
            2: dict.fromkeys(USERS, USER),
            3: {number: Parameter(_interrupt(number), INT32, known=False) for number in _numbers(row["interrupts"])},
        },
        int(row["motors"]),
        tuple(_numbers(row["inputs"])),
        range(int(row["outputs"])),
        (*_numbers(row["analog"]), VOLTAGE, TEMPERATURE),
        chip_units,
        Status(int(row["wrong_motor"])),
    )


MODULES: Mapping[str, Module] = {row["module"]: _module(row) for row in rows(__file__, "modules.csv")}
"""By the number in the module's name."""
COMMON = Module(
    "", {number: row for number, row in _AXIS.items() if row.known and number != Axis.UNIT_MODE}, {0: GLOBAL}
)
"""What one-axis modules have in common; for a module without a table."""
PREFIX = "TMCM"


def module_of(product: str) -> Module:
    """The table of a product such as `TMCM-1241`; `TMCM` is that one, any other product has what all have in common."""
    return MODULES["1241"] if product == PREFIX else MODULES.get(product.removeprefix(f"{PREFIX}-"), COMMON)
