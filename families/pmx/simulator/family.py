"""The family of the Arcus PMX-2ED-SA controllers: their `[[bus.drive]]` table, read, built, written.

A controller as it was read from a unit becomes such a table, and a table the settings to write to a unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from fractions import Fraction

from multidrop.base.files import split_lines
from multidrop.dialects.family import Motion
from multidrop.dialects.program_files import errors
from multidrop.dialects.units import Scale
from multidrop.dialects.values import VARIABLES as USERS
from multidrop.dialects.values import Snapshot, Value
from multidrop.families.pmx.manual import program_file
from multidrop.families.pmx.manual.program_file import Undecodable
from multidrop.families.pmx.manual.script_compiler import ERASED
from multidrop.families.pmx.simulator.axis import Until
from multidrop.families.pmx.simulator.commands import MODEL
from multidrop.families.pmx.simulator.controller import BAUDS
from multidrop.families.pmx.simulator.device import PROGRAMS, PmxDevice, PmxPort
from multidrop.families.pmx.simulator.pulses import PULSES_A_TURN
from multidrop.families.pmx.simulator.settings import AXES, VARIABLES
from multidrop.simulator.cell.drive_keys import (
    ENCODER_KEYS,
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
from multidrop.simulator.cell.writer import CellEntry, DriveText, plain, remark
from multidrop.simulator.family import Effort, Place, Shadow, SimulatedFamily, StoredProgram, Unit, UsbSide

NAMES_OF_AXES = ("x", "y")
INPUTS, ANALOG_FULL_SCALE = range(1, 9), 5000
"""Digital inputs, and the end of scale of the analog inputs in millivolts."""
NAMES = tuple(f"V{n}" for n in range(VARIABLES))
"""The variables of its programs."""


def _axis_scale(settings: Mapping[str, Setting], axis: str, scale: Scale | None) -> AxisScale:
    """A count is a pulse, or with StepNLoop an encoder count of SLR pulses (7.17)."""
    ratio = settings.get(f"SLR{axis}", 1) if settings.get(f"SL{axis}") in (1, "1") else 1
    return AxisScale(
        scale, None, Fraction(str(ratio)), "a PMX does not tell the pulses of a turn (SW1 and SW2 set them)"
    )


def _check_setting(table: Table, word: str, value: Setting) -> None:
    if not (word.isascii() and word.isalnum()):
        raise table.wrong(quoted(word), "is not a PMX command")


def _program(snapshot: Snapshot) -> list[str]:
    """The program as its file, or as A-SCRIPT, where that gives the same memory; else as compiled lines."""
    tokens, scripts = [token for _, token in snapshot.program], [list(snapshot.remarked)]
    with suppress(Undecodable):
        scripts.append(program_file.readable([f"SA{at}={token}" for at, token in snapshot.program]))
    for script in scripts:
        text = "\n".join(script)
        if script and not errors(program_file.check(text)) and program_file.memory(text, "program") == tokens:
            return script
    return [f"SA{at}={token}" for at, token in snapshot.program if token != ERASED]


def _worlds(snapshot: Snapshot) -> dict[str, dict[str, object]]:
    worlds: dict[str, dict[str, object]] = {axis.lower(): {} for axis in AXES}
    if snapshot.inputs:
        worlds["x"]["inputs"] = [[0.0, n, level] for n, level in snapshot.inputs]
    for axis, counts in zip(worlds, snapshot.analog, strict=False):
        worlds[axis]["analog"] = [[0.0, counts]]
    return {axis: keys for axis, keys in worlds.items() if keys}


def _shadow(device: PmxDevice) -> Shadow:
    axes = dict(zip(NAMES_OF_AXES, device.controller.axes, strict=True))

    def rest() -> None:
        for program in range(PROGRAMS):
            device.programs.control(program, 0, 0.0)

    def motion(now: float) -> tuple[Motion, ...]:
        return tuple(
            Motion(axis.position(now), axis.speed(now) if axis.pulses.profile.moving(now) else 0, name)
            for name, axis in axes.items()
        )

    def align(name: str, position: int, now: float) -> None:
        axis = axes[name]
        axis.halt(now)
        if axis.loop.on:  # it follows the encoder, and cannot be set (8.1.2)
            axis.set_encoder(position, now)
            axis.loop.stay(now)
        else:
            axis.set_position(position, now)

    def efforts() -> dict[str, Effort]:
        return {
            name: Effort(axis.pulses.profile, PULSES_A_TURN, axis.unit, stalls=axis.loop.on)
            for name, axis in axes.items()
        }

    def awaits(name: str, now: float) -> str | None:  # noqa: ARG001
        homing = axes[name].homing
        if homing is None:
            return None
        limit = "limit_plus" if homing.direction > 0 else "limit_minus"
        return {Until.HOME: "home", Until.LIMIT: limit}.get(homing.awaited or Until.END, "")

    return Shadow(rest, motion, align, awaits, efforts, {name: axis.rotor for name, axis in axes.items()})


class SimulatedPmx(SimulatedFamily):
    """Simulated PMX controllers."""

    name = "pmx"
    addressed = True

    @classmethod
    def read_drive(cls, table: Table, folder: Folder) -> DriveSpec:
        common = common_keys(table, folder)
        name = table.text("name", "00")
        if not (len(name) == 2 and name.isascii() and name.isdigit()):
            raise table.wrong("name", f"cannot be {quoted(name)}", "valid: two digits, 00 to 99")
        if table.boolean("party", False):
            raise table.wrong("party", "is for MCode drives", "leave it out: a PMX always has an address")
        world = table.table("world", "[bus.drive.world]")
        settings = read_settings(table.table("set", "set"), _check_setting)
        scales = read_units(table, NAMES_OF_AXES)
        geared = {axis: _axis_scale(settings, axis.upper(), scales.get(axis)) for axis in NAMES_OF_AXES}
        x, y = read_worlds(world, NAMES_OF_AXES, (*WORLD_KEYS, *ENCODER_KEYS), INPUTS, ANALOG_FULL_SCALE, geared)
        return DriveSpec(
            **common,
            name=name,
            set=settings,
            variables=read_variables(table, lambda name: name in NAMES, f"valid: {NAMES[0]} to {NAMES[-1]}"),
            identity=read_identity(table, ("part", "version"), {"position": len(AXES), "encoder": len(AXES)}),
            world=x,
            further=(y,),
            units=scales,
        )

    @classmethod
    def build(cls, spec: DriveSpec, place: Place) -> Unit:
        """Build a controller that is powered up. Raises Diagnostic for settings that it refuses, and for a program."""
        device = PmxDevice(spec, place.baud)
        return Unit(
            device=device,
            port=PmxPort(device, alone=place.alone, any_baud=place.baud not in BAUDS.values()),
            worlds=dict(zip(NAMES_OF_AXES, device.worlds, strict=True)),
            shadow=_shadow(device),
            inputs=INPUTS,
            counts=ANALOG_FULL_SCALE,
            on_usb=UsbSide(
                lambda: f"2ED{device.controller.settings.number}", lambda text, now: device.execute(text, now)
            ),
        )

    @classmethod
    def describe(cls, snapshot: Snapshot) -> DriveText:
        readings = [reading for reading in snapshot.readings.readings if reading.name != "DN"]
        return DriveText(
            personality="PMX",
            name=snapshot.name,
            remarks=snapshot.remarks,
            unread=snapshot.readings.unread,
            program=_program(snapshot),
            settings=[
                CellEntry(reading.name, reading.value, remark(reading))
                for reading in readings
                if reading.section != USERS
            ],
            variables=[
                CellEntry(reading.name, reading.value)
                for reading in readings
                if reading.section == USERS and reading.value
            ],
            identity=[
                *(
                    CellEntry(key, plain(text))
                    for key, text in (("part", snapshot.part), ("version", snapshot.version))
                    if text
                ),
                *(CellEntry(key, list(counts)) for key, counts in snapshot.counters.items()),
            ],
            worlds=_worlds(snapshot),
            baud=snapshot.baud,
        )

    @classmethod
    def wanted(cls, spec: DriveSpec) -> dict[str, Value]:
        """The settings of a controller in a cell file; a variable that is left out is 0."""
        settings = {name: held for name, held in spec.set.items() if not isinstance(held, tuple)}
        return {"DN": f"{MODEL}{spec.name}", **settings, **{name: spec.variables.get(name, 0) for name in NAMES}}

    @classmethod
    def program(cls, spec: DriveSpec) -> StoredProgram:
        if not spec.program:
            return StoredProgram()
        return StoredProgram(
            tuple(program_file.memory(spec.program, spec.program_name)), tuple(split_lines(spec.program.strip()))
        )
