"""The variables and flags of a simulated drive, and the forms of arguments that several instructions share.

A plain variable is a number in memory with the range that the table of mnemonics gives it. The others have a reader or
a writer. Compiled lines get closures from `reader` and `writer`, which raise DriveFault: 20 unknown, 21 wrong value, 25
read only, 30 not there, 32 a label, 35 cannot be read, 37 not in this drive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import inf

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import Argument, Compare, NameTerm, Number, Statement, Text
from multidrop.families.lexium.manual.groups import BANKED, TRIPS, TRIPS_WITH_VALUE
from multidrop.families.lexium.simulator.event_loop import EventLoop
from multidrop.families.lexium.simulator.state.errors import DriveFault
from multidrop.families.lexium.simulator.state.expressions import PI, Compiler, Read, Value, whole
from multidrop.families.lexium.simulator.state.memory import slot, within
from multidrop.families.lexium.simulator.state.program_memory import Action

Write = Callable[[Value], None]

LEAST_MS = 10
"""With hMT (manual 5.1.6)."""
MOST_DELAY = 65535
"""HT and MT together (manual 5.1.86)."""


WATCHED = ("HC", "LD", "LG", "LT", "RC", "SM", "TD", "TQ", "WT", "CM")
"""Plain variables on which it depends what happens next."""
POINTS = (1, 2, 3, 4, 9, 10, 11, 12)
"""Inputs and outputs that bear a word each."""
Compile = Callable[[Statement], Action]
"""Compiles the statement of one instruction. Raises DriveFault for a wrong form."""


def is_place(argument: Argument | None) -> bool:
    return isinstance(argument, (NameTerm, Number))


def only(statement: Statement) -> Argument | None:
    """The one argument. Raises DriveFault (24) for none or several."""
    if len(statement.arguments) != 1:
        raise DriveFault(E.ILLEGAL_DATA)
    return statement.arguments[0]


def pair(statement: Statement) -> tuple[Argument | None, Argument | None]:
    """One or two arguments. Raises DriveFault (24)."""
    if not 1 <= len(statement.arguments) <= 2:
        raise DriveFault(E.ILLEGAL_DATA)
    first, second = (*statement.arguments, None)[:2]
    return first, second


def bare(action: Action) -> Compile:
    """An instruction without arguments."""

    def compiler(statement: Statement) -> Action:
        if statement.arguments or statement.equals:
            raise DriveFault(E.INSTRUCTION_NOT_SETTABLE if statement.equals else E.ILLEGAL_DATA)
        return action

    return compiler


def missing(statement: Statement) -> DriveFault:
    """The error of an instruction that lacks its arguments."""
    return DriveFault(E.ILLEGAL_DATA if statement.equals else E.NOT_EXECUTABLE)


def _unreadable() -> Value:
    raise DriveFault(E.NOT_PRINTABLE)


class Variables:
    """The variables of one drive."""

    def __init__(self, drive: EventLoop) -> None:
        core, motor, self._nvm = drive.core, drive.motor, drive.power_unit.nvm
        self._memory, self._values, self._program = core.memory, core.values, core.program
        self._timeline, self._motor = core.timeline, motor
        self._inputs, self._outputs = motor.inputs, drive.output_lines
        self.compiler = Compiler(self.reader, core.model.floating)
        self._readers: dict[str, Read] = {
            "LS": _unreadable,
            "PI": lambda: PI,
            "BY": lambda: int(core.thread.running),
            **self._motion_readers(),
            **self._point_readers(),
        }
        self._writers: dict[str, Write] = {
            **{word: partial(self._take, word, act) for word, act in self._acts().items()},
            **{name: partial(self._write_geometry, name) for name in ("EL", "SA")},
            "BD": self._write_baud,
            "IF": self._write_input_flag,
            "MF": self._write_mf,
            "ST": self._write_st,
        }

    def _motion_readers(self) -> dict[str, Read]:
        motor, timeline = self._motor, self._timeline
        axis, counters, status, hmt = motor.axis, motor.counters, motor.status, motor.hmt
        return {
            "P": lambda: counters.shown(counters.source, timeline.now),
            "C1": lambda: counters.value("C1", timeline.now),
            "C2": lambda: counters.shown("C2", timeline.now),
            "V": lambda: status.speed(timeline.now),
            "AV": lambda: status.rotor_speed(timeline.now),
            "AF": lambda: hmt.status(timeline.now),
            "CB": lambda: hmt.bounds,
            "LL": lambda: hmt.shown_lag(timeline.now),
            "MV": lambda: 1 if timeline.now < axis.profile.end else int(status.reported(timeline.now)),
            "MP": lambda: int(status.positioning(timeline.now)),
            "VC": lambda: int(status.changing(timeline.now)),
            "I6": lambda: int(status.at_index(timeline.now)),
            "IT": lambda: round(motor.heat.bridge(timeline.now)),
        }

    def _point_readers(self) -> dict[str, Read]:
        inputs, timeline = self._inputs, self._timeline
        low, high = inputs.points.low, inputs.points.high

        def trip(bit: int) -> Value:
            defined = self._motor.trips.defined.get(bit)
            return defined.value if defined else 0

        return {
            **{word: partial(trip, TRIPS[word]) for word in TRIPS_WITH_VALUE},
            "IN": lambda: inputs.levels((*low, *high)),
            "IL": lambda: inputs.levels(low),
            "IH": lambda: inputs.levels(high),
            "I5": lambda: inputs.analog(timeline.now),
            **{f"I{n}": partial(lambda n: int(inputs.active(n)), n) for n in POINTS},
        }

    def _acts(self) -> dict[str, Callable[[int], None]]:
        """What writing a whole number in the range of its word does. A Lexium's outputs are one group."""
        motor, timeline, points = self._motor, self._timeline, self._inputs.points
        low = points.low if points.shared else points.outputs
        groups = {"OT": (*low, *points.high), "OL": low, "OH": points.high}
        return {
            **{name: partial(self._set, name) for name in (*WATCHED, *(f"D{n}" for n in POINTS))},
            **{name: partial(self._set_velocity, name) for name in ("VI", "VM")},
            **{name: partial(self._set_counter, name) for name in ("P", "C1", "C2")},
            **{name: partial(self._set_encoder, name) for name in ("DB", "PM", "SF")},
            **{word: partial(self._outputs.write_all, group) for word, group in groups.items()},
            **{f"O{n}": partial(self._outputs.write, n) for n in POINTS},
            "AS": self._set_as,
            "CB": motor.hmt.set_bounds,
            "DE": lambda number: motor.enable(number, timeline.now),
            "EE": self._set_ee,
            "ER": self._set_error,
            "FL": self._set_fl,
            "HT": partial(self._set_delay, "MT", "HT"),
            "JE": self._set_je,
            "LK": self._set_lock,
            "MS": self._set_ms,
            "MT": partial(self._set_delay, "HT", "MT"),
            "RD": self._set_rd,
            "TE": lambda number: motor.trips.arm(number, timeline.now),
            "TS": self._set_ts,
        }

    def reader(self, word: str) -> Read:
        row = self._memory.readable(word)
        if row is not None and self._memory.product in row.zero_on:
            return lambda: 0
        if row is not None and word in self._readers:
            return self._readers[word]
        values, key = self._values, word if row else slot(word)
        if row is not None and row.kind == "reserved":
            raise DriveFault(E.ILLEGAL_DATA)
        if row is not None and (word not in values or row.access == "WO"):
            raise DriveFault(E.NOT_PRINTABLE)

        def read() -> Value:
            try:
                return values[key]
            except KeyError:
                raise DriveFault(E.NO_SUCH_NAME) from None

        return read

    def writer(self, word: str) -> Write:
        """Return a closure that writes a variable, or raises DriveFault."""
        row, values = self._memory.row(word), self._values
        if row is None:
            return self._user_writer(word)
        if word in self._writers:
            return self._writers[word]
        if row.access in ("RO", "RC") or row.kind in ("keyword", "math"):
            raise DriveFault(E.READ_ONLY)
        if word not in values:
            raise DriveFault(E.UNKNOWN_VARIABLE)
        if row.low_encoder is not None or row.values:
            return partial(self._take, word, partial(values.__setitem__, word))
        low, high = row.low or 0, row.high or 0
        if isinstance(row.default, float):

            def write_float(value: Value) -> None:
                values[word] = float(within(value, low, high))

            return write_float

        def write(value: Value) -> None:
            if not isinstance(value, int):
                value = whole(value)
            if not low <= value <= high:
                raise DriveFault(E.OUT_OF_RANGE)
            values[word] = value

        return write

    def _user_writer(self, word: str) -> Write:
        values, key = self._values, slot(word)
        if word in self._program.labels:
            raise DriveFault(E.LABEL_NOT_SETTABLE)
        if not self.declared(word):
            raise DriveFault(E.UNKNOWN_VARIABLE)

        def write(value: Value) -> None:
            if key not in values:
                raise DriveFault(E.UNKNOWN_VARIABLE)
            values[key] = within(whole(value), -0x80000000, 0x7FFFFFFF)

        return write

    def declared(self, word: str) -> bool:
        """Return whether a user variable is there, or will be once the program has run its VA line."""
        return word in self._memory.scopes or word in self._program.declared

    # Arguments.

    def value(self, argument: Argument | None, floating: bool = False) -> Read:
        """Return a closure that reads an argument's value. Raises DriveFault (21, 24) for what has none."""
        if isinstance(argument, Text):
            raise DriveFault(E.OUT_OF_RANGE)
        if argument is None or isinstance(argument, Compare):
            raise DriveFault(E.ILLEGAL_DATA)
        return self.compiler.expression(argument, floating)

    def numbers(self, act: Callable[[list[int]], None], least: int, most: int) -> Compile:
        """An instruction with whole numbers: so many at least and at most. Raises DriveFault (24, 34, 38)."""

        def compiler(statement: Statement) -> Action:
            count = len(statement.arguments)
            if not count:
                raise missing(statement)
            if count < least:
                raise DriveFault(E.NO_SEPARATOR)
            if count > most:
                raise DriveFault(E.ILLEGAL_DATA)
            reads = [self.value(argument) for argument in statement.arguments]
            return lambda: act([whole(read()) for read in reads])

        return compiler

    # What writing does.

    def _take(self, word: str, act: Callable[[int], None], value: Value) -> None:
        act(self._memory.checked(word, value))

    def _set(self, name: str, number: int) -> None:
        """Set a number on which it depends what happens next."""
        self._values[name] = number
        self._timeline.replan()

    # Velocities and resolution.

    def _set_velocity(self, name: str, number: int) -> None:
        """VI or VM, in the unit of motion; VI stays below VM. Raises DriveFault (77, and the code of the word)."""
        values = self._values
        if not self._memory.counting:
            self._check_resolution(number)
        if name == "VI" and number >= values["VM"]:
            raise DriveFault(E.VI_NOT_BELOW_VM)
        if name == "VM" and number <= values["VI"]:
            raise DriveFault(E.VM_NOT_ABOVE_VI)
        values[name] = number

    def _check_resolution(self, velocity: int) -> None:
        """Raise DriveFault (77) for what this resolution does not reach, on products that have such a bound."""
        fastest = self._memory.model.per_microstep
        if fastest and velocity > self._values["MS"] * fastest:
            raise DriveFault(E.VELOCITY_TOO_HIGH)

    def _set_ts(self, number: int) -> None:
        self._check_resolution(number)
        self._motor.torque.set_speed(number)

    def _set_ms(self, number: int) -> None:
        """A, D, VI and VM keep their ratio to the full step (manual 5.1.85), as far as their ranges let them.

        They do so in steps, also while an LMM counts and they are not in force.
        """
        memory, values, steps, words = self._memory, self._values, self._memory.steps, self._memory.words
        if memory.counting and not memory.model.free_ms and number != values["MS"]:
            raise DriveFault(E.OUT_OF_RANGE)
        if memory.counting:
            self._check_ratio({"MS": number})
        if values.get("AS") and number < LEAST_MS:
            raise DriveFault(E.OUT_OF_RANGE)
        ratio = number / values["MS"]
        for name in BANKED:
            low, high = words[name].bounds()
            steps[name] = min(max(int(steps[name] * ratio + 0.5), low or 0), high or inf)
        steps["VI"] = min(steps["VI"], (words["VM"].high or inf) - 1)
        steps["VM"] = max(steps["VM"], steps["VI"] + 1)
        self._motor.axis.rescale(lambda: values.update(MS=number), self._timeline.now)
        self._timeline.replan()

    def _check_ratio(self, changed: Mapping[str, Value]) -> None:
        """Check that microsteps are fine enough for the encoder, two for a count (manual 5.1.38).

        A product whose MS is locked at its finest while it counts is always fine enough. Raises DriveFault (36).
        """
        new = {**self._values, **changed}
        if self._memory.model.free_ms and new["MS"] * round(360 / new["SA"]) < new["EL"] * 8:
            raise DriveFault(E.ENCODER_RATIO)

    def _write_geometry(self, name: str, value: Value) -> None:
        """EL and SA: what a step and a count are, which are not changed on the move."""
        row, change = self._memory.row(name), {name: value if name == "SA" else whole(value)}
        if row is None or not row.accepts(change[name]) or self._moving():
            raise DriveFault(E.OUT_OF_RANGE)
        if self._values.get("EE"):
            self._check_ratio(change)
        self._motor.axis.rescale(lambda: self._values.update(change), self._timeline.now)
        self._timeline.replan()

    def _set_rd(self, number: int) -> None:
        if self._moving():
            raise DriveFault(E.DIRECTION_WHILE_MOVING)
        self._values["RD"] = number
        self._motor.axis.orient(self._timeline.now)

    def _moving(self) -> bool:
        return self._motor.status.moving(self._timeline.now)

    # The encoder and hMT.

    def _set_ee(self, number: int) -> None:
        """Change between steps and counts: on an LMD MS is 256 meanwhile (manual 7.3.7), and then what it was."""
        memory, t = self._memory, self._timeline.now
        if number and not self._values["EE"]:
            self._check_ratio({})
            # Check that VI is a count or more, on a product that has a code for less (5-21, 9). Raises DriveFault (90).
            if memory.model.per_microstep is None and self._values["VI"] < memory.steps_per_count:
                raise DriveFault(E.VELOCITY_TOO_LOW)
        self._motor.limit_stop.relocate(lambda: self._motor.axis.switch_unit("EE", number, t), t)
        self._timeline.replan()

    def _set_encoder(self, name: str, number: int) -> None:
        """DB, PM, SF: a rotor that is out of place already is brought back, or stalls."""
        self._set(name, number)
        self._motor.encoder.look(self._timeline.now)

    def _write_st(self, value: Value) -> None:
        """The flag that the drive sets; a user clears it, and sets it where it may be written."""
        self._set("ST", self._memory.flag("ST", value))
        self._motor.encoder.clear()

    def _set_as(self, number: int) -> None:
        if number and self._memory.steps["MS"] < LEAST_MS:
            raise DriveFault(E.OUT_OF_RANGE)
        self._motor.hmt.set_mode(number, self._timeline.now)
        self._motor.hmt.tune()

    def _write_mf(self, value: Value) -> None:
        """Up to VM, in steps/s whatever the unit of motion is now."""
        row, number = self._memory.row("MF"), whole(value)
        if row is None or not row.accepts(number) or number > self._memory.steps["VM"]:
            raise DriveFault(E.MAKE_UP_FREQUENCY)
        self._values["MF"] = number

    # Counters, delays, points, the program and the port.

    def _set_counter(self, name: str, number: int) -> None:
        motor, t = self._motor, self._timeline.now
        counter = motor.counters.source if name == "P" else name
        motor.limit_stop.relocate(lambda: motor.axis.set_counter(counter, number, t), t)
        self._timeline.replan()

    def _set_delay(self, other: str, name: str, number: int) -> None:
        """HT or MT, which together may not be more than 65535 (manual 5.1.86)."""
        if number + self._values[other] > MOST_DELAY:
            raise DriveFault(E.OUT_OF_RANGE)
        self._set(name, number)

    def _set_error(self, number: int) -> None:
        """Only 0 clears; programs also set a code of their own."""
        self._values["ER"], self._values["EF"] = number, int(number != 0)

    def _write_input_flag(self, value: Value) -> None:
        """Clearing IF ends what IV waits for."""
        self._values["IF"] = self._memory.flag("IF", value)
        self._memory.awaited = ""

    def _set_lock(self, number: int) -> None:
        """A lock that has been saved is opened by CP or FD only (manual 5.1.75)."""
        if not number and self._values["LK"] and self._nvm.locked:
            raise DriveFault(E.PROGRAM_LOCKED)
        self._values["LK"] = number

    def _write_baud(self, value: Value) -> None:
        row, number = self._memory.row("BD"), whole(value)
        if row is None or not row.accepts(number):
            raise DriveFault(E.NO_SUCH_BAUD)
        self._values["BD"] = number

    def _set_fl(self, number: int) -> None:
        """Following wants inputs 3 and 4 to be a clock; they are so together (manual 5.1.46)."""
        points = self._inputs.points
        if number and self._inputs.types[points.clocks[0]][0] not in points.clock_types:
            raise DriveFault(E.WRONG_CLOCK_TYPE)
        self._set("FL", number)

    def _set_je(self, number: int) -> None:
        """Write JE, and let an active jog input turn. The line succeeds even if the motion may not begin."""
        self._values["JE"] = number
        self._motor.update_jog()
