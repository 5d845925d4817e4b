"""What is read of a controller: settings, conditions, values for plots, and all of it for a snapshot; its controls.

A controller prints one value a command, so each setting is one short request, StepNLoop's state and delta are read only
where it is on, and a program counter only while the program runs. (PMX-2ED-SA manual 7, 9, A, table 9.0.)

Positions, outputs, motor drivers and the joystick's switch are states of the moment and no settings. A low speed above
the high speed is refused, and the times of ACC and DEC depend on both: speeds go first.

A number means a position after ABS and a distance after INC, and another client may have sent either: each move of a
control sends ABS first.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

from multidrop.base.errors import Diagnostic, Inexpressible
from multidrop.dialects.by_hand import ByHand
from multidrop.dialects.codec import Priority, Procedure, Request
from multidrop.dialects.controls import Controls, Homing, by_mode, controls_of, homings_of
from multidrop.dialects.listed_settings import ListedParameters
from multidrop.dialects.state import who
from multidrop.dialects.values import (
    VARIABLES,
    Actions,
    Conditions,
    Facts,
    Lamp,
    Levels,
    Pace,
    Parameters,
    Part,
    Plan,
    Progress,
    Reading,
    SlotState,
    Snapshot,
    Value,
    Values,
    printed_number,
)
from multidrop.dialects.values import number as number_of
from multidrop.families.pmx.host.codec import PmxState
from multidrop.families.pmx.host.operations import (
    PROGRAMS,
    PmxExchange,
    PmxOperations,
    number,
)
from multidrop.families.pmx.host.programs import PmxPrograms
from multidrop.families.pmx.manual import table
from multidrop.families.pmx.manual.program_file import RAW
from multidrop.families.pmx.manual.table import Corrects, PmxRetention

UNREAD = (("JO", "the controller does not report whether the joystick is on"),)
RATIO = "SLR"
_AXIS = re.compile(rf"([A-Z]+?)([{''.join(table.AXES)}])\Z")


def base(name: str) -> str:
    if name in table.COMMANDS:
        return name
    match = _AXIS.match(name)
    return match[1] if match is not None and match[1] in table.COMMANDS else name.rstrip("0123456789")


def axis(name: str) -> str:
    match = _AXIS.match(name)
    return match[2] if match is not None and name not in table.COMMANDS and match[1] in table.COMMANDS else ""


def reading(name: str, value: Value) -> Reading:
    word = base(name)
    if word == "V":
        return Reading(name, value, VARIABLES, default=0)
    return Reading(name, value, unit=table.COMMANDS[word].unit, fixed=name in table.WIRE)


def _turn(row: table.PmxCommand) -> tuple[bool, bool]:
    """Speeds first, and last what switches StepNLoop on or lets it correct."""
    return row.unit != "pulses/s", row.corrects in (Corrects.LOOP, Corrects.WHILE_ON)


NAMES = tuple(
    word
    for row in sorted(table.ROWS, key=_turn)
    if row.kept in (PmxRetention.SETTING, PmxRetention.WIRE)
    for word in row.words()
)
"""The settings in the order in which they are written."""


NAME_FORM, RATIO_FORM, WHOLE_FORM = r"[0-9A-Za-z]{1,8}", r"\d{1,6}(?:\.\d+)?", r"-?\d{1,19}"


def _speeds_in_order(order: list[str], low: str, now: Mapping[str, Value], goal: Mapping[str, Value]) -> list[str]:
    """The order in which the low speed is never above the high one: the high one first, unless it falls too far."""
    high = low.replace("LSPD", "HSPD")
    rest = [name for name in order if name not in (low, high)]
    falls = high in goal and number_of(goal[high]) < number_of(now.get(low))
    pair = [name for name in ((low, high) if falls else (high, low)) if name in goal]
    return [*pair, *rest]


def _written(name: str, value: Value) -> str:
    if base(name) == RATIO:
        return f"{number_of(value):.3f}"
    return value if isinstance(value, str) else str(int(number_of(value)))


class PmxParameters(ListedParameters):
    """The settings of a PMX."""

    state: PmxState

    language = "PMX"
    saving = "STORE"
    later = frozenset(table.WIRE)
    unread = UNREAD

    def names(self) -> Sequence[str]:
        return NAMES

    def read_one(self, name: str) -> Procedure[Reading]:
        ratio = base(name) == RATIO
        form = NAME_FORM if name == "DN" else RATIO_FORM if ratio else WHOLE_FORM
        reply = yield from PmxExchange(self.state).answered(
            replace(self.state.codec.request(self.state.address, name), expect=form)
        )
        return reading(name, reply.text if name == "DN" else float(reply.text) if ratio else int(reply.text))

    def communicates(self, name: str) -> bool:
        return name in table.WIRE

    def risk(self, name: str, value: Value, now: Mapping[str, Value]) -> str:
        match table.COMMANDS[base(name)].corrects:
            case Corrects.LOOP if value:
                return "StepNLoop corrects the position by moves"
            case Corrects.JOYSTICK:
                return "the joystick may be on, and then it can turn the motor"
            case Corrects.WHILE_ON if now.get(f"SL{axis(name)}"):
                return "StepNLoop is on and may correct the position by a move"
            case Corrects.POWER_UP if value:
                return "programs run after power-up"
        return ""

    def checked(self, name: str, value: Value) -> Value:
        if name not in NAMES:
            raise Diagnostic(f"{name}: is not a setting of the controller")
        if name == "DN":
            if not re.fullmatch(r"2ED\d\d", str(value)):
                raise Diagnostic(f"DN = {value}: valid: 2ED00 to 2ED99")
            return value
        if isinstance(value, (str, tuple)):
            raise Diagnostic(f"{name} = {value}: takes a number")
        row = table.COMMANDS[base(name)]
        if isinstance(row.low, int) and not float(value).is_integer():
            raise Diagnostic(f"{name} = {value}: takes a whole number")
        if row.low is None or row.high is None or not row.low <= value <= row.high:
            raise Diagnostic(f"{name} = {value}: valid: {row.low} to {row.high}")
        return value

    def ordered(self, names: list[str], now: Mapping[str, Value], goal: Mapping[str, Value]) -> list[str]:
        for low in [name for name in names if base(name) == "LSPD"]:
            names = _speeds_in_order(names, low, now, goal)
        return names

    def line(self, name: str, value: Value) -> str:
        return f"{name}={_written(name, value)}"

    def rescales(self, name: str) -> bool:
        return base(name) in table.RESCALING

    def ready(self) -> Procedure[str]:
        if (yield from PmxOperations(self.state).moving()):
            return f"{who(self.state)} moves: stop it first"
        if (yield from PmxOperations(self.state).busy()):
            return f"{who(self.state)} runs a program: SR0=0 and SR1=0 end them"
        return ""

    def save(self) -> Procedure[object]:
        return PmxOperations(self.state).perform("STORE")

    def conflict(self, plan: Plan, others: Collection[str]) -> str:
        numbers = [str(change.after)[-2:] for change in plan if change.name == "DN"]
        return f"another controller of the line has number {numbers[0]}" if numbers and numbers[0] in others else ""


RUNNING, PAUSED = 1, 2
"""Values of SASTAT at which SPC counts."""
SPEEDS = ("LSPD", "HSPD", "ACC", "DEC")
POINTS = 8
"""Inputs, and outputs."""
ON_AXIS = ((1 << 6, "home"), (1 << 4, "lim+"), (1 << 5, "lim-"), (1 << 9, "Z"))
"""The bits of a motor status that are switches of the axis."""
DRIVERS = {"X": 1, "Y": 2}
"""The bits of EO."""
BAUDS = {1: 9600, 2: 19200, 3: 38400, 4: 57600, 5: 115200}
"""By DB (table 6.1)."""
POLARITY = 1 << 10
"""The bit of POLX that inverts the inputs."""


def _facts(state: PmxState, names: Sequence[str]) -> Procedure[dict[str, Value]]:
    doubts: list[Request] = []
    facts: dict[str, Value] = {}
    for name in names:
        facts[name] = yield from number(state, name, Priority.POLL, doubts)
    if doubts:
        yield from PmxExchange(state).beyond_doubt(doubts[0])
    return facts


def _programs(state: PmxState) -> Procedure[Facts]:
    facts = yield from _facts(state, [f"SASTAT{program}" for program in PROGRAMS])
    active = [f"SPC{program}" for program in PROGRAMS if facts[f"SASTAT{program}"] in (RUNNING, PAUSED)]
    return facts | (yield from _facts(state, active))


def clearing(axis: str) -> str:
    """The command that clears the errors of an axis, which takes no move before (7.11, 7.17)."""
    return f"CLR{axis.upper()}"


def _of_axis(axis: str, facts: Mapping[str, int]) -> Conditions:
    status, loop, on = facts.get(f"MST{axis}"), facts.get(f"SLS{axis}"), facts.get("EO")
    more = []
    if status is not None:
        more.append(("status", ", ".join(table.status_words(status))))
    if loop is not None:
        more.append(("StepNLoop", table.loop_words(loop)))
    if f"DX{axis}" in facts:
        more.append(("delta", str(facts[f"DX{axis}"])))
    code = (status or 0) & table.LIMIT_ERROR
    text = table.trouble_words(code)
    if loop is not None and loop in table.LOOP_ERRORS:
        code, text = loop, f"StepNLoop {table.loop_words(loop)}"
    return Conditions(
        axis=axis.lower(),
        lamps=tuple(Lamp("", name, None if status is None else bool(status & bit)) for bit, name in ON_AXIS),
        error=code,
        error_text=text,
        clears=clearing(axis) if code else "",
        disabled=f"EO{DRIVERS[axis]}=0" if on is not None and not on & DRIVERS[axis] else "",
        more=tuple(more),
        commanded=facts.get(f"SL{axis}") == 0,
        unit="counts" if facts.get(f"SL{axis}") else "pulses",
        pace=_pace(axis, facts),
    )


def _slot(n: int, state: int | None, facts: Facts) -> SlotState:
    place = str(facts.get(f"SPC{n}", "")) if state in (RUNNING, PAUSED) else ""
    words = "not read yet" if state is None else table.program_words(state)
    return SlotState(f"program {n}", words, place, state == RUNNING)


def _pace(axis: str, facts: Mapping[str, int]) -> Pace | None:
    """The ramps of a move: an axis's own values count unless they are 0. Times are in ms."""
    low, high, up, down = (facts.get(name + axis) or facts.get(name, 0) for name in SPEEDS)
    down = down if facts.get("EDEC") else up
    if not (high > low and up and down):
        return None
    return Pace(low, high, (high - low) / up * 1000, (high - low) / down * 1000)


class PmxActions(Actions):
    """What a program asks of a PMX."""

    state: PmxState

    no_error = ""

    def homings(self, axis: str) -> Mapping[str, Mapping[str, str]]:
        return by_mode(homings_of(__file__, axis.upper()))

    def run(self, axis: str, velocity: int | str) -> tuple[str, ...]:
        """Set the axis's high speed, and jog; a velocity of 0 stops it."""
        name = axis.upper()
        if isinstance(velocity, str):
            raise Inexpressible(
                f"{velocity}: a PMX has speeds without a sign, which a scale may turn; give steps a second"
            )
        return (
            (f"HSPD{name}={abs(velocity)}", f"J{name}{'-' if velocity < 0 else '+'}") if velocity else (f"STOP{name}",)
        )

    def output(self, number: int, on: bool) -> str:
        return f"DO{number}={on:d}"

    def clear(self, axis: str) -> str:
        return clearing(axis)


class PmxValues(Values):
    """What is read of a PMX."""

    state: PmxState

    @property
    def parameters(self) -> Parameters:
        return PmxParameters(self.state)

    @property
    def by_hand(self) -> ByHand:
        from multidrop.families.pmx.host.by_hand import PmxByHand

        return PmxByHand(self.state)

    def snapshot(self, progress: Progress) -> Procedure[Snapshot]:
        readings = yield from PmxParameters(self.state).read(progress)
        identity = yield from PmxExchange(self.state).answered(self.state.codec.request(self.state.address, "ID"))
        remarks = []
        for axis in table.AXES:
            if (yield from number(self.state, f"MST{axis}")) & table.MOVING:
                remarks.append(f"{axis} moved while it was read: its position is one of that moment")
        for program in PROGRAMS:
            if (yield from number(self.state, f"SASTAT{program}")) == RUNNING:
                remarks.append(f"program {program} ran while it was read")
        counters = {}
        for key, word in (("position", "P"), ("encoder", "E")):
            counters[key] = (yield from number(self.state, f"{word}X")), (yield from number(self.state, f"{word}Y"))
        analog = (yield from number(self.state, "AI1")), (yield from number(self.state, "AI2"))
        values = readings.values
        # A bit of DI is 1 if the input is at ground, or with the other polarity if it is not.
        inverted = not int(number_of(values.get("POLX"))) & POLARITY
        levels = Levels("DI", tuple((n + 1, n) for n in range(POINTS)), inverted=inverted)
        listed = yield from PmxPrograms(self.state).listing()
        return Snapshot(
            kind="pmx",
            product="PMX",
            part=identity.text,
            version=self.state.version,
            name=str(values.get("DN", self.state.name))[-2:] or self.state.address,
            baud=BAUDS.get(int(number_of(values.get("DB"))), 0),
            readings=readings,
            program=tuple((int(row[1]), row[2]) for line in listed if (row := RAW.fullmatch(line))),
            counters=counters,
            inputs=levels.of((yield from number(self.state, levels.word))),
            levels=levels,
            active=bool(remarks),
            analog=analog,
            remarks=tuple(remarks),
        )

    def parts(self, facts: Facts) -> Sequence[Part]:
        parts = []
        for axis in table.AXES:
            loop = (f"SLS{axis}", f"DX{axis}") if facts.get(f"SL{axis}") else ()
            parts.append(Part(axis, partial(_facts, self.state, names=(f"MST{axis}", *loop))))
        parts += [
            Part("points", partial(_facts, self.state, names=("DI", "DO", "EO"))),
            Part("programs", partial(_programs, self.state)),
        ]
        parts += [
            Part(f"settings {axis}", partial(_facts, self.state, names=(f"SL{axis}",)), slow=True)
            for axis in table.AXES
        ]
        named = [speed + axis for axis in ("", *table.AXES) for speed in SPEEDS]
        return [
            *parts,
            *(Part(name, partial(_facts, self.state, names=(name,)), slow=True) for name in (*named, "EDEC")),
        ]

    def fold(self, facts: Facts) -> tuple[Conditions, ...]:
        """The conditions of both axes; points and programs are with the first."""
        whole = {name: value for name, value in facts.items() if isinstance(value, int)}
        one, other = (_of_axis(axis, whole) for axis in table.AXES)
        lamps = list(one.lamps)
        for word, output in (("DI", False), ("DO", True)):
            bits = whole.get(word)
            on = [None if bits is None else bool(bits >> n & 1) for n in range(POINTS)]
            lamps += [Lamp(str(n + 1), "", each, output) for n, each in enumerate(on)]
        states = [whole.get(f"SASTAT{n}") for n in PROGRAMS]
        active = [n for n in PROGRAMS if states[n] in (RUNNING, PAUSED)]
        failed = ", ".join(str(n) for n in PROGRAMS if states[n] == 4)
        one = replace(
            one,
            lamps=tuple(lamps),
            program=", ".join(f"{n} {table.program_words(states[n] or 0)}" for n in active),
            runs=None if None in states else RUNNING in states,  # a paused one moves nothing
            slots=tuple(_slot(n, states[n], facts) for n in PROGRAMS),
            line=", ".join(str(facts.get(f"SPC{n}", "")) for n in active),
            more=(*one.more, *([("program", f"{failed} stopped by an error")] if failed else ())),
        )
        return one, other

    def check(self, word: str) -> str:
        row = table.lookup(word)
        if row is None or "R" not in row.access:
            raise Diagnostic(
                f"{word} cannot be polled: it reads no value", hint="valid: V0 to V63, DI, SSPD and others"
            )
        return word.upper()

    def again(self, word: str, priority: Priority) -> Procedure[float]:
        reply = yield from PmxExchange(self.state).answered(
            replace(self.state.codec.request(self.state.address, word), priority=priority)
        )
        return printed_number(who(self.state), word, reply.text)

    def controls(self, axis: str) -> Controls:
        return controls_of(__file__, axis.upper(), table.AXES.index(axis.upper()) + 1)

    def homings(self, axis: str) -> Sequence[Homing]:
        """The five ways, each in both directions. (7.10.)"""
        return homings_of(__file__, axis.upper())

    @property
    def actions(self) -> Actions:
        return PmxActions(self.state)
