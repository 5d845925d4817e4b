"""The variables and flags of a simulated drive, and the forms of arguments that several instructions share.

A plain variable is a number in memory with the range that the table of mnemonics gives it. The others have a reader or
a writer (`MotionVariables` has those of motion). Compiled lines get closures from `reader` and `writer`, which raise
Fault: 20 unknown, 21 wrong value, 25 read only, 30 not there, 32 a label, 35 cannot be read, 37 not in this drive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import inf

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Argument, Compare, Name, Number, Statement, Text
from multidrop.dialects.mcode.manual.mnemonic import Mnemonic
from multidrop.simulator.lexium.event_loop import EventLoop
from multidrop.simulator.lexium.motion.counters import BITS
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import PI, Read, Value, compile_value, compile_whole, whole
from multidrop.simulator.lexium.state.interpreter import Core
from multidrop.simulator.lexium.state.memory import BANKED, slot, within
from multidrop.simulator.lexium.state.program_memory import Action

Write = Callable[[Value], None]

LEAST_MS = 10
"""With hMT (manual 5.1.6)."""
MOST_DELAY = 65535
"""HT and MT together (manual 5.1.86)."""


class MotionVariables:
    """The motion variables of one drive."""

    def __init__(self, core: Core, motor: Motor) -> None:
        self._memory, self._values, self._timeline, self._motor = core.memory, core.values, core.timeline, motor

    def readers(self) -> dict[str, Read]:
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

    def writers(self) -> dict[str, Write]:
        return {
            **{name: partial(self._write_velocity, name) for name in ("VI", "VM")},
            "MS": self._write_ms,
            "EE": self._write_ee,
            "HT": partial(self._write_delay, "MT", "HT"),
            "MT": partial(self._write_delay, "HT", "MT"),
            **{name: partial(self._write_counter, name) for name in ("P", "C1", "C2")},
            "ST": self._write_st,
            "MF": self._write_mf,
            "TS": self._write_ts,
            "AS": self._write_as,
            "CB": lambda value: self._motor.hmt.set_bounds(self._memory.checked("CB", value)),
            "DE": lambda value: self._motor.enable(self._memory.checked("DE", value), self._timeline.now),
            **{name: partial(self._write_geometry, name) for name in ("EL", "SA")},
            **{name: partial(self._write_encoder, name) for name in ("DB", "PM", "SF")},
            "RD": self._write_rd,
        }

    # Velocities and resolution.

    def _write_velocity(self, name: str, value: Value) -> None:
        """VI or VM, in the unit of motion; VI stays below VM. Raises Fault (21, 77, and the code of the word)."""
        number, values = self._memory.checked(name, value), self._values
        if not self._memory.counting:
            self._check_resolution(number)
        if name == "VI" and number >= values["VM"]:
            raise Fault(E.VI_NOT_BELOW_VM)
        if name == "VM" and number <= values["VI"]:
            raise Fault(E.VM_NOT_ABOVE_VI)
        values[name] = number

    def _check_resolution(self, velocity: int) -> None:
        """Raise Fault (77) for what this resolution does not reach, on products that have such a bound."""
        fastest = self._memory.model.per_microstep
        if fastest and velocity > self._values["MS"] * fastest:
            raise Fault(E.VELOCITY_TOO_HIGH)

    def _write_ts(self, value: Value) -> None:
        number = self._memory.checked("TS", value)
        self._check_resolution(number)
        self._motor.torque.set_speed(number)

    def _write_ms(self, value: Value) -> None:
        """A, D, VI and VM keep their ratio to the full step (manual 5.1.85), as far as their ranges let them."""
        memory, values, number = self._memory, self._values, self._memory.checked("MS", value)
        if memory.counting and not memory.model.free_ms and number != values["MS"]:
            raise Fault(E.OUT_OF_RANGE)
        if memory.counting:
            self._check_ratio({"MS": number})
        if values.get("AS") and number < LEAST_MS:
            raise Fault(E.OUT_OF_RANGE)
        self._keep_ratio(memory.steps, number / values["MS"])
        self._motor.axis.rescale(lambda: values.update(MS=number), self._timeline.now)
        self._timeline.replan()

    def _keep_ratio(self, steps: dict[str, Value], ratio: float) -> None:
        """Scale A, D, VI and VM in steps, also while an LMM counts and they are not in force."""
        words = self._memory.words
        for name in BANKED:
            steps[name] = int(steps[name] * ratio + 0.5)
        for name in BANKED:
            low, high = words[name].bounds()
            steps[name] = min(max(steps[name], low or 0), high or inf)
        steps["VI"] = min(steps["VI"], (words["VM"].high or inf) - 1)
        steps["VM"] = max(steps["VM"], steps["VI"] + 1)

    def _check_ratio(self, changed: Mapping[str, Value]) -> None:
        """Check that microsteps are fine enough for the encoder, two for a count (manual 5.1.38). Raises Fault (36).

        A product whose MS is locked at its finest while it counts is always fine enough.
        """
        new = {**self._values, **changed}
        if self._memory.model.free_ms and new["MS"] * round(360 / new["SA"]) < new["EL"] * 8:
            raise Fault(E.ENCODER_RATIO)

    def _write_geometry(self, name: str, value: Value) -> None:
        """EL and SA: what a step and a count are, which are not changed on the move."""
        row = self._memory.row(name)
        number = value if name == "SA" else whole(value)
        if row is None or not row.accepts(number) or self._moving():
            raise Fault(E.OUT_OF_RANGE)
        if self._values.get("EE"):
            self._check_ratio({name: number})
        self._motor.axis.rescale(lambda: self._memory.write(row, value), self._timeline.now)
        self._timeline.replan()

    def _write_rd(self, value: Value) -> None:
        number = self._memory.checked("RD", value)
        if self._moving():
            raise Fault(E.DIRECTION_WHILE_MOVING)
        self._values["RD"] = number
        self._motor.axis.orient(self._timeline.now)

    def _moving(self) -> bool:
        return self._motor.status.moving(self._timeline.now)

    # The encoder and hMT.

    def _write_ee(self, value: Value) -> None:
        """Change between steps and counts: on an LMD MS is 256 meanwhile (manual 7.3.7), and then what it was."""
        number, t = self._memory.checked("EE", value), self._timeline.now
        if number and not self._values["EE"]:
            self._check_ratio({})
            # Check that VI is a count or more, on a product that has a code for less (5-21, 9). Raises Fault (90).
            memory = self._memory
            if memory.model.per_microstep is None and self._values["VI"] < memory.steps_per_count:
                raise Fault(E.VELOCITY_TOO_LOW)
        self._motor.limit_stop.relocate(lambda: self._motor.axis.switch_unit("EE", number, t), t)
        self._timeline.replan()

    def _write_encoder(self, name: str, value: Value) -> None:
        """DB, PM, SF: a rotor that is out of place already is brought back, or stalls."""
        row = self._memory.row(name)
        if row is not None:
            self._memory.write(row, value)
        self._timeline.replan()
        self._motor.encoder.look(self._timeline.now)

    def _write_st(self, value: Value) -> None:
        """The flag that the drive sets; a user clears it, and sets it where it may be written."""
        self._values["ST"] = self._memory.flag("ST", value)
        self._motor.encoder.clear()
        self._timeline.replan()

    def _write_as(self, value: Value) -> None:
        number = self._memory.checked("AS", value)
        if number and self._memory.steps["MS"] < LEAST_MS:
            raise Fault(E.OUT_OF_RANGE)
        self._motor.hmt.set_mode(number, self._timeline.now)
        self._motor.hmt.tune()

    def _write_mf(self, value: Value) -> None:
        """Up to VM, in steps/s whatever the unit of motion is now."""
        row, number = self._memory.row("MF"), whole(value)
        if row is None or not row.accepts(number) or number > self._memory.steps["VM"]:
            raise Fault(E.MAKE_UP_FREQUENCY)
        self._values["MF"] = number

    # Counters and delays.

    def _write_counter(self, name: str, value: Value) -> None:
        motor, t, number = self._motor, self._timeline.now, self._memory.checked(name, value)
        counter = motor.counters.source if name == "P" else name
        motor.limit_stop.relocate(lambda: motor.axis.set_counter(counter, number, t), t)
        self._timeline.replan()

    def _write_delay(self, other: str, name: str, value: Value) -> None:
        """HT or MT, which together may not be more than 65535 (manual 5.1.86)."""
        number = self._memory.checked(name, value)
        if number + self._values[other] > MOST_DELAY:
            raise Fault(E.OUT_OF_RANGE)
        self._values[name] = number
        self._timeline.replan()


WATCHED = ("HC", "LD", "LG", "LT", "RC", "SM", "TD", "TQ", "WT", "CM")
"""Plain variables on which it depends what happens next."""
POINTS = (1, 2, 3, 4, 9, 10, 11, 12)
"""Inputs and outputs that bear a word each."""
WITH_VALUE = ("TI", "TP", "TT", "TR", "TA")
"""Trips that read as the first number of their set-up."""
Compile = Callable[[Statement], Action]
"""Compiles the statement of one instruction. Raises Fault for a wrong form."""


def is_place(argument: Argument | None) -> bool:
    return isinstance(argument, (Name, Number))


def only(statement: Statement) -> Argument | None:
    """The one argument. Raises Fault (24) for none or several."""
    if len(statement.arguments) != 1:
        raise Fault(E.ILLEGAL_DATA)
    return statement.arguments[0]


def pair(statement: Statement) -> tuple[Argument | None, Argument | None]:
    """One or two arguments. Raises Fault (24)."""
    if not 1 <= len(statement.arguments) <= 2:
        raise Fault(E.ILLEGAL_DATA)
    first, second = (*statement.arguments, None)[:2]
    return first, second


def bare(action: Action) -> Compile:
    """An instruction without arguments."""

    def compiler(statement: Statement) -> Action:
        if statement.arguments or statement.equals:
            raise Fault(E.INSTRUCTION_NOT_SETTABLE if statement.equals else E.ILLEGAL_DATA)
        return action

    return compiler


def missing(statement: Statement) -> Fault:
    """The error of an instruction that lacks its arguments."""
    return Fault(E.ILLEGAL_DATA if statement.equals else E.NOT_EXECUTABLE)


def _unreadable() -> Value:
    raise Fault(E.NOT_PRINTABLE)


class Variables:
    """The variables of one drive."""

    def __init__(self, drive: EventLoop) -> None:
        core, motor, self._nvm = drive.core, drive.motor, drive.power_unit.nvm
        self._memory, self._values, self._program, self._timeline = (
            core.memory,
            core.values,
            core.program,
            core.timeline,
        )
        self._inputs, self._outputs, self._motor = motor.inputs, drive.output_lines, motor
        motion = MotionVariables(core, motor)
        self._readers: dict[str, Read] = {
            "LS": _unreadable,
            "PI": lambda: PI,
            "BY": lambda: int(core.thread.running),
            **motion.readers(),
            **self._io_readers(),
        }
        self._writers: dict[str, Write] = {
            "BD": self._write_baud,
            "ER": self._write_error,
            "IF": self._write_input_flag,
            "LK": self._write_lock,
            **{name: partial(self._write_watched, name) for name in WATCHED},
            **motion.writers(),
            **self._io_writers(),
        }

    def _io_readers(self) -> dict[str, Read]:
        inputs, timeline = self._inputs, self._timeline
        low, high = inputs.points.low, inputs.points.high

        def trip(bit: int) -> Value:
            defined = self._motor.trips.defined.get(bit)
            return defined.value if defined else 0

        return {
            **{word: partial(trip, BITS[word]) for word in WITH_VALUE},
            "IN": lambda: inputs.levels((*low, *high)),
            "IL": lambda: inputs.levels(low),
            "IH": lambda: inputs.levels(high),
            "I5": lambda: inputs.analog(timeline.now),
            **{f"I{n}": partial(lambda n: int(inputs.active(n)), n) for n in POINTS},
        }

    def _io_writers(self) -> dict[str, Write]:
        """By word. A Lexium's outputs are one group."""
        memory, outputs, points = self._memory, self._outputs, self._inputs.points
        low = points.low if points.shared else points.outputs
        groups = {"OT": (*low, *points.high), "OL": low, "OH": points.high}

        def write_group(word: str, group: tuple[int, ...], value: Value) -> None:
            outputs.write_all(memory.checked(word, value), group)

        def write_output(n: int, value: Value) -> None:
            outputs.write(n, memory.checked(f"O{n}", value))

        return {
            "TE": lambda value: self._motor.trips.arm(memory.checked("TE", value), self._timeline.now),
            "JE": self._write_je,
            "FL": self._write_fl,
            **{word: partial(write_group, word, group) for word, group in groups.items()},
            **{f"O{n}": partial(write_output, n) for n in POINTS},
            **{f"D{n}": partial(self._write_filter, n) for n in POINTS},
        }

    def reader(self, word: str) -> Read:
        row = self._memory.readable(word)
        if row is not None and self._memory.product in row.zero_on:
            return lambda: 0
        if row is not None and word in self._readers:
            return self._readers[word]
        values, key = self._values, word if row else slot(word)
        if row is not None and row.kind == "reserved":
            raise Fault(E.ILLEGAL_DATA)
        if row is not None and (word not in values or row.access == "WO"):
            raise Fault(E.NOT_PRINTABLE)

        def read() -> Value:
            try:
                return values[key]
            except KeyError:
                raise Fault(E.NO_SUCH_NAME) from None

        return read

    def writer(self, word: str) -> Write:
        """Return a closure that writes a variable, or raises Fault."""
        row = self._memory.row(word)
        if row is None:
            return self._user_writer(word)
        if word in self._writers:
            return self._writers[word]
        if row.access in ("RO", "RC") or row.kind in ("keyword", "math"):
            raise Fault(E.READ_ONLY)
        if word not in self._values:
            raise Fault(E.UNKNOWN_VARIABLE)
        if row.low_encoder is not None or row.values:
            return partial(self._memory.write, row)
        return self._plain_writer(row)

    def value(self, argument: Argument | None, floating: bool = False) -> Read:
        """Return a closure that reads an argument's value. Raises Fault (21, 24) for what has none."""
        if isinstance(argument, Text):
            raise Fault(E.OUT_OF_RANGE)
        if argument is None or isinstance(argument, Compare):
            raise Fault(E.ILLEGAL_DATA)
        if not self._memory.model.floating:
            return compile_whole(argument, self.reader)
        return compile_value(argument, self.reader, floating)

    def numbers(self, statement: Statement, least: int, most: int) -> Callable[[], list[int]]:
        """Return a closure that reads all arguments as whole numbers. Raises Fault (24, 34, 38)."""
        count = len(statement.arguments)
        if not count:
            raise missing(statement)
        if count < least:
            raise Fault(E.NO_SEPARATOR)
        if count > most:
            raise Fault(E.ILLEGAL_DATA)
        reads = [self.value(each) for each in statement.arguments]
        return lambda: [whole(read()) for read in reads]

    def declared(self, word: str) -> bool:
        """Return whether a user variable is there, or will be once the program has run its VA line."""
        return word in self._memory.scopes or word in self._program.declared

    def _user_writer(self, word: str) -> Write:
        values, key = self._values, slot(word)
        if word in self._program.labels:
            raise Fault(E.LABEL_NOT_SETTABLE)
        if not self.declared(word):
            raise Fault(E.UNKNOWN_VARIABLE)

        def write(value: Value) -> None:
            if key not in values:
                raise Fault(E.UNKNOWN_VARIABLE)
            values[key] = within(whole(value), -0x80000000, 0x7FFFFFFF)

        return write

    def _plain_writer(self, row: Mnemonic) -> Write:
        values, name = self._values, row.name
        low, high = row.low or 0, row.high or 0
        if isinstance(row.default, float):

            def write_float(value: Value) -> None:
                values[name] = float(within(value, low, high))

            return write_float

        def write(value: Value) -> None:
            if not isinstance(value, int):
                value = whole(value)
            if not low <= value <= high:
                raise Fault(E.OUT_OF_RANGE)
            values[name] = value

        return write

    def _write_watched(self, name: str, value: Value) -> None:
        row = self._memory.row(name)
        if row is not None:
            self._memory.write(row, value)
        self._timeline.replan()

    def _write_error(self, value: Value) -> None:
        """Only 0 clears; programs also set a code of their own."""
        number = self._memory.checked("ER", value)
        self._values["ER"], self._values["EF"] = number, int(number != 0)

    def _write_input_flag(self, value: Value) -> None:
        """Clearing IF ends what IV waits for."""
        self._values["IF"] = self._memory.flag("IF", value)
        self._memory.awaited = ""

    def _write_lock(self, value: Value) -> None:
        """A lock that has been saved is opened by CP or FD only (manual 5.1.75)."""
        number = self._memory.checked("LK", value)
        if not number and self._values["LK"] and self._nvm.locked:
            raise Fault(E.PROGRAM_LOCKED)
        self._values["LK"] = number

    def _write_baud(self, value: Value) -> None:
        row, number = self._memory.row("BD"), whole(value)
        if row is None or not row.accepts(number):
            raise Fault(E.NO_SUCH_BAUD)
        self._values["BD"] = number

    def _write_filter(self, n: int, value: Value) -> None:
        self._values[f"D{n}"] = self._memory.checked(f"D{n}", value)
        self._timeline.replan()

    def _write_fl(self, value: Value) -> None:
        """Following wants inputs 3 and 4 to be a clock; they are so together (manual 5.1.46)."""
        number, points = self._memory.checked("FL", value), self._inputs.points
        if number and self._inputs.types[points.clocks[0]][0] not in points.clock_types:
            raise Fault(E.WRONG_CLOCK_TYPE)
        self._values["FL"] = number
        self._timeline.replan()

    def _write_je(self, value: Value) -> None:
        """Write JE, and let an active jog input turn. The line succeeds even if the motion may not begin."""
        self._values["JE"] = self._memory.checked("JE", value)
        self._motor.update_jog()
