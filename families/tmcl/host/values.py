"""What is read of a module: settings, conditions, values for plots, and all of it for a snapshot.

The extended error flags (207) are not read, since that clears them. (TMCL firmware manuals, "Axis parameters".)
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

from multidrop.base.errors import Diagnostic, Refused
from multidrop.dialects.by_hand import ByHand
from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.controls import BY, Controls, Homing, by_mode, controls_of, homings_of
from multidrop.dialects.listed_settings import ListedParameters
from multidrop.dialects.program_files import Held
from multidrop.dialects.state import who
from multidrop.dialects.values import (
    UNREAD,
    Actions,
    Conditions,
    Facts,
    Lamp,
    Pace,
    Parameters,
    Part,
    Plan,
    Progress,
    Reading,
    Readings,
    Snapshot,
    Value,
    Values,
    number,
)
from multidrop.families.tmcl.host.codec import TmclState
from multidrop.families.tmcl.host.motions import DRIVER_FAULTS
from multidrop.families.tmcl.host.operations import TmclOperations, motors, read
from multidrop.families.tmcl.host.programs import TmclPrograms
from multidrop.families.tmcl.manual.commands import (
    AxisParameter,
    Command,
    Global,
    TmclCall,
    parameter,
    setting_name,
)
from multidrop.families.tmcl.manual.modules import BAUDS, COMMON, MODULES, RELATIVE_FROM, Module, module_of
from multidrop.families.tmcl.manual.parameters import Starts, TmclParameter, row_of

GLOBAL_PREFIX = "G"
ADDRESS = f"{GLOBAL_PREFIX}{int(Global.ADDRESS)}"
NOT_STORED = (3, 6)
"""The statuses of a module that lacks a parameter, or does not store it: wrong type, command not available."""


def setting_names(module: Module, motors: int) -> tuple[str, ...]:
    """The settings of a module, in the order in which they are written."""
    axis = _ordered(module.axis)
    own = [f"{number}{f'_{motor}' if motor else ''}" for motor in range(motors) for number in axis]
    return (*own, *(f"{GLOBAL_PREFIX}{number}" for number in _ordered(module.banks[0])))


def _ordered(table: Mapping[int, TmclParameter]) -> list[int]:
    """The settings of a table by their numbers, in the order in which they are written."""
    return sorted((number for number, each in table.items() if each.setting), key=lambda number: table[number].restored)


def _row(module: Module, name: str) -> TmclParameter:
    of_module, number, _ = _parts(name)
    return (module.banks[0] if of_module else module.axis)[number]


def _fact(name: str) -> TmclParameter | None:
    """A row with the facts of a parameter that every module shares; None: there is no such parameter."""
    of_module, number, _ = _parts(name)
    return row_of(number, of_module)


def _call(name: str, command: Command, value: int = 0) -> TmclCall:
    """The command for a setting; `command` is the one for an axis parameter."""
    of_module, number, motor = _parts(name)
    if of_module:
        command = {Command.GAP: Command.GGP, Command.SAP: Command.SGP}[command]
    return TmclCall(command, number, motor, value)


def reading(name: str, value: int, module: Module) -> Reading:
    of_module, number, _ = _parts(name)
    row = _row(module, name)
    unit = ", ".join(part for part in (row.title, row.unit) if part)
    default = row.fresh if row.known else None
    return Reading(name, value, unit=unit, default=default, fixed=row.wire)


def _parts(name: str) -> tuple[bool, int, int]:
    """Divide a name: whether it is a global parameter, the number, the motor."""
    asked = parameter(name)
    return (asked.command == Command.GGP, asked.type, asked.motor) if asked is not None else (False, -1, 0)


class TmclParameters(ListedParameters):
    """The settings of a TMCL module."""

    state: TmclState

    language = "TMCL"
    saving = "STAP"

    def names(self) -> Sequence[str]:
        return setting_names(module_of(self.state.product), self.state.motors or 1)

    def read(self, progress: Progress) -> Procedure[Readings]:
        """Read every setting of the motors, which are counted first."""
        yield from motors(self.state)
        return (yield from super().read(progress))

    def read_one(self, name: str) -> Procedure[Reading]:
        return reading(name, (yield from read(self.state, _call(name, Command.GAP))), module_of(self.state.product))

    def spelled(self, name: str) -> str:
        return setting_name(name)

    def communicates(self, name: str) -> bool:
        row = _fact(name)
        return row is not None and row.wire

    def risk(self, name: str, value: Value, now: Mapping[str, Value]) -> str:
        row = _fact(name)
        if row is None:
            return ""
        if row.risk and value:
            return row.risk
        return "a move may wait for it" if row.starts is not Starts.NOTHING and now.get(name) == 0 else ""

    def checked(self, name: str, value: Value) -> int:
        if name not in self.names():
            raise Diagnostic(f"{name}: is not a setting of the module")
        row = _row(module_of(self.state.product), name)
        if isinstance(value, (str, tuple)) or not float(value).is_integer() or int(value) not in row.limits:
            raise Diagnostic(f"{name} = {value}: valid: {row.valid}")
        return int(value)

    def line(self, name: str, value: Value) -> str:
        return str(_call(name, Command.SAP, int(number(value))))

    def rescales(self, name: str) -> bool:
        return _parts(name)[:2] == (False, AxisParameter.MICROSTEPS)

    def ready(self) -> Procedure[str]:
        return f"{who(self.state)} moves: stop it first" if (yield from TmclOperations(self.state).moving()) else ""

    def save(self) -> Procedure[None]:
        """Store the axis parameters in EEPROM, one by one; a module may lack some."""
        yield from motors(self.state)
        for name in self.names():
            if not name.startswith(GLOBAL_PREFIX):
                call = _call(name, Command.GAP)
                try:
                    yield from TmclOperations(self.state).perform(f"STAP {call.type}, {call.motor}")
                except Refused as refusal:
                    if refusal.code not in NOT_STORED:
                        raise

    def conflict(self, plan: Plan, others: Collection[str]) -> str:
        numbers = [str(change.after) for change in plan if change.name == ADDRESS]
        return f"another module of the line has address {numbers[0]}" if numbers and numbers[0] in others else ""


STATE = (AxisParameter.TARGET_POSITION, AxisParameter.POSITION_REACHED)
FLAGS = AxisParameter.DRIVER_FLAGS
SWITCHES = (
    (AxisParameter.HOME_SWITCH, "home"),
    (AxisParameter.RIGHT_SWITCH, "lim+"),
    (AxisParameter.LEFT_SWITCH, "lim-"),
)
RAMP = (AxisParameter.MAXIMUM_VELOCITY, AxisParameter.MAXIMUM_ACCELERATION)
SETTINGS = (AxisParameter.RUN_CURRENT, AxisParameter.STANDBY_CURRENT, AxisParameter.FREEWHEELING, *RAMP)
KNOWN = (*STATE, FLAGS, *(axis for axis, _ in SWITCHES), *SETTINGS)
RUNS = "RUNS"
"""Whether the module's program runs."""
ABSENT = "absent"
"""A parameter that the module refuses: it lacks it."""
FULL_CURRENT = 255


def _key(axis: AxisParameter, motor: int) -> str:
    return f"{axis.name} {motor}"


def _count(state: TmclState) -> Procedure[Facts]:
    yield from motors(state, Priority.POLL)
    return {}


def _program(state: TmclState) -> Procedure[Facts]:
    return {RUNS: int((yield from TmclOperations(state).busy(Priority.POLL)))}


def _parameters(state: TmclState, motor: int, wanted: Sequence[AxisParameter]) -> Procedure[Facts]:
    values: dict[str, int | str] = {}
    for axis in wanted:
        try:
            values[_key(axis, motor)] = yield from read(state, TmclCall(Command.GAP, axis, motor), Priority.POLL)
        except Refused:
            values[_key(axis, motor)] = ABSENT
    return values


def _conditions(state: TmclState, facts: Facts, motor: int) -> Conditions:
    """The conditions of a motor: one ramp up and down. Older modules count it and velocities in units of their chip."""
    values = {axis: value for axis in KNOWN if isinstance(value := facts.get(_key(axis, motor)), int)}
    run, hold = values.get(AxisParameter.RUN_CURRENT), values.get(AxisParameter.STANDBY_CURRENT)
    speed, ramp = (values.get(axis) for axis in RAMP)
    chip = module_of(state.product).chip_units
    freewheels = "freewheels: parameter 204" if values.get(AxisParameter.FREEWHEELING) else ""
    faults = ", ".join(words for bit, words in DRIVER_FAULTS.items() if values.get(FLAGS, 0) & bit)
    return Conditions(
        axis=str(motor) if state.motors > 1 else "",
        lamps=tuple(Lamp("", function, bool(values[axis])) for axis, function in SWITCHES if axis in values),
        error=UNREAD if faults else 0,
        error_text=faults,
        cause=faults,
        program="running" if facts.get(RUNS) else "",
        runs=bool(facts[RUNS]) if RUNS in facts else None,
        target=None if values.get(AxisParameter.POSITION_REACHED) else values.get(AxisParameter.TARGET_POSITION),
        run_current=None if run is None else round(run * 100 / FULL_CURRENT),
        hold_current=None if hold is None else round(hold * 100 / FULL_CURRENT),
        released="parameter 7 is 0" if hold == 0 else freewheels,
        commanded=True,  # the ramp's counter (axis parameter 1); an encoder has one of its own (209)
        unit="microsteps",
        speed="of 2047" if chip else "",
        pace=Pace(0, speed, ramp, ramp) if speed and ramp and not chip else None,
    )


class TmclActions(Actions):
    """What a program asks of a TMCL module."""

    state: TmclState

    no_error = "a module has no error to read: each refusal says its own; read('AP208') shows the driver's flags"

    def homings(self, axis: str) -> Mapping[str, Mapping[str, str]]:
        return by_mode(homings_of(__file__, axis or "0"))

    def run(self, axis: str, velocity: int | str) -> tuple[str, ...]:
        return (f"ROR {axis or '0'}, {velocity}",)

    def output(self, number: int, on: bool) -> str:
        return f"SIO {number}, 2, {on:d}"

    def word(self, word: str, axis: str) -> str:
        """A parameter by its number, of the motor that it names or that is meant; any other word as it is."""
        asked = parameter(word)
        if asked is None:
            return word
        named = re.search(r"[_/]\d$", word) is not None
        return (
            f"G{asked.type}"
            if asked.command == Command.GGP
            else f"AP{asked.type}_{asked.motor if named else axis or 0}"
        )

    def ports(self) -> Mapping[int, str]:
        return {port: f"GIO {port}, 0" for port in module_of(self.state.product).inputs}


class TmclValues(Values):
    """What is read of a TMCL module."""

    state: TmclState

    @property
    def parameters(self) -> Parameters:
        return TmclParameters(self.state)

    @property
    def by_hand(self) -> ByHand:
        from multidrop.families.tmcl.host.by_hand import TmclByHand

        return TmclByHand(self.state)

    def snapshot(self, progress: Progress) -> Procedure[Snapshot]:
        readings = yield from TmclParameters(self.state).read(progress)
        remarks = []
        if active := (yield from TmclOperations(self.state).moving()):
            remarks.append("moving while it was read: its position is one of that moment")
        if runs := (yield from TmclOperations(self.state).busy()):
            remarks.append("its program ran while it was read")
        try:
            held = yield from TmclPrograms(self.state).read((), lambda done, total: None)
        except Refused as refused:
            held = Held()
            remarks.append(f"its program was not read: {refused}")
        count = yield from motors(self.state)
        module, (major, _, minor) = self.state.product.rpartition("-")[2], self.state.version.partition(".")
        if count > (simulated := MODULES[module].motors if module in MODULES else 1):
            remarks.append(f"it has {count} motors; the simulated module has {simulated}")
        positions, targets = [], []
        for motor in range(count):
            positions.append((yield from read(self.state, TmclCall(Command.GAP, AxisParameter.ACTUAL_POSITION, motor))))
            targets.append((yield from read(self.state, TmclCall(Command.GAP, AxisParameter.TARGET_POSITION, motor))))
        code = readings.values.get(f"G{int(Global.BAUD)}")
        return Snapshot(
            kind="tmcl",
            product=self.state.product,
            version=f"{module}V{major}{minor}"
            if module.isdecimal() and major
            else "",  # as in its text form, `1241V115`
            name=self.state.address,
            baud=BAUDS.get(code, 0) if isinstance(code, int) else 0,
            readings=readings,
            counters={"position": tuple(positions), **({"target": tuple(targets)} if targets != positions else {})},
            program=tuple((line.at, line.text) for line in held.lines),
            active=active or runs,
            remarks=tuple(remarks),
        )

    def parts(self, facts: Facts) -> Sequence[Part]:
        """The parts of a module, for each motor that was counted; at first they are counted."""
        if not self.state.motors:
            return (Part("motors", partial(_count, self.state)),)
        parts: list[Part] = [Part("program", partial(_program, self.state))]
        for motor in range(self.state.motors):
            some = (FLAGS, *(axis for axis, _ in SWITCHES))
            asked = [*STATE, *(axis for axis in some if facts.get(_key(axis, motor)) != ABSENT)]
            parts.append(Part(f"motor {motor}", partial(_parameters, self.state, motor=motor, wanted=asked)))
            for axis in SETTINGS:
                parts.append(
                    Part(_key(axis, motor), partial(_parameters, self.state, motor=motor, wanted=(axis,)), slow=True)
                )
        return parts

    def fold(self, facts: Facts) -> tuple[Conditions, ...]:
        return tuple(_conditions(self.state, facts, motor) for motor in range(self.state.motors))

    def check(self, word: str) -> str:
        asked = parameter(word)
        if asked is None:
            raise Diagnostic(
                f"{word} cannot be polled", hint="valid: AP and a parameter, /MOTOR after it; as AP206, AP1/1"
            )
        if asked.changed_by_reading:
            raise Diagnostic(f"{word} cannot be polled: reading it clears it", hint=f"{asked} reads it once")
        return f"AP{word}" if word[0].isdigit() else word.upper()

    def again(self, word: str, priority: Priority) -> Procedure[float]:
        """Read a parameter, none whose reading changes the module: `check` refuses that."""
        asked = parameter(word)
        assert asked is not None
        return float((yield from read(self.state, asked, priority)))

    def controls(self, axis: str) -> Controls:
        controls = controls_of(__file__, axis or "0")
        counted = RELATIVE_FROM.get(self.state.relative.get(int(axis or 0), -1), "from where it counts is not known")
        return {**controls, BY: replace(controls[BY], about=counted)}

    def homings(self, axis: str) -> Sequence[Homing]:
        """The search as it is set; of modules with a table also the modes of 193, which others may number otherwise."""
        homings = homings_of(__file__, axis or "0")
        return homings if module_of(self.state.product) is not COMMON else homings[:1]

    @property
    def actions(self) -> Actions:
        return TmclActions(self.state)
