"""The TMCL modules, with the numbers of parameters that the maker's library lists for each: `modules.csv`.

Positions are microsteps. Velocities and accelerations are microsteps/s and microsteps/s2 on modules with a TMC5130,
TMC5160 or TMC4361; those with a TMC428 or TMC429 count in units of that chip.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from multidrop.base.files import rows
from multidrop.families.tmcl.manual.commands import AxisParameter, Status
from multidrop.families.tmcl.manual.parameters import GROUPS, INT32, TmclParameter

MIRRORED, INVERTED = 64, 128
"""Added to a mode of the reference search: the right switch in place of the left one; the home switch inverted."""


_AXIS, _CHIP, _GLOBAL = GROUPS["axis"], GROUPS["chip"], GROUPS["global"]
GLOBAL: Mapping[int, TmclParameter] = {number: row for number, row in _GLOBAL.items() if row.known}
RELATIVE_FROM: Mapping[int, str] = {
    0: "counts from the last target",
    1: "counts from here",
    2: "counts from the encoder's position",
}
"""The values of axis parameter 127; only some modules have it, those that count in microsteps."""
USER = TmclParameter("user variable; STGP keeps it without power", INT32)
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
    axis: Mapping[int, TmclParameter]
    banks: Mapping[int, Mapping[int, TmclParameter]]
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
            3: {
                number: TmclParameter(_interrupt(number), INT32, known=False) for number in _numbers(row["interrupts"])
            },
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
    "", {number: row for number, row in _AXIS.items() if row.known and number != AxisParameter.UNIT_MODE}, {0: GLOBAL}
)
"""What one-axis modules have in common; for a module without a table."""
PREFIX = "TMCM"


def module_of(product: str) -> Module:
    """The table of a product such as `TMCM-1241`; `TMCM` is that one, any other product has what all have in common."""
    return MODULES["1241"] if product == PREFIX else MODULES.get(product.removeprefix(f"{PREFIX}-"), COMMON)
