"""Instructions of the motor, and those with several settings: inputs, outputs, limits, trips, print format, name.

Manual 5.1.20, 5.1.33, 5.1.52 to 5.1.54, 5.1.64, 5.1.78, 5.1.80, 5.1.84, 5.1.87, 5.1.93, 5.1.97, 5.1.104, 5.1.115,
5.1.117, 5.1.122 to 5.1.132.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import inf

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import Argument, Number, Statement
from multidrop.families.lexium.manual.groups import TRIPS, TRIPS_WITH_VALUE
from multidrop.families.lexium.manual.statements import device_name as device_name_of
from multidrop.families.lexium.manual.table import MNEMONICS, lookup
from multidrop.families.lexium.manual.value_forms import MOST_REPEATS
from multidrop.families.lexium.simulator.event_loop import EventLoop
from multidrop.families.lexium.simulator.language.variables import Compile, Variables, bare, is_place, missing, only
from multidrop.families.lexium.simulator.motion.inputs import ANALOG
from multidrop.families.lexium.simulator.state.errors import DriveFault
from multidrop.families.lexium.simulator.state.expressions import whole
from multidrop.families.lexium.simulator.state.memory import Trip
from multidrop.families.lexium.simulator.state.program_memory import Action

FIRST_INPUT = 1
PRINT_FORMAT = (10, 6, 0, 0)
"""PF: width, decimals, scientific, left."""


class MotorCommands:
    """The instructions of the motor of one drive. `begun` counts the motions that they have begun."""

    def __init__(self, drive: EventLoop, variables: Variables) -> None:
        self._memory, self._timeline = drive.core.memory, drive.core.timeline
        self._variables, self._motor = variables, drive.motor
        self.begun = 0

    def commands(self) -> Mapping[str, Compile]:
        begin = {**dict.fromkeys(("MA", "MR"), self._move), **dict.fromkeys(("HM", "HI", "HF"), self._home)}
        begin |= {"SL": self._slew, "SC": self._test}

        def counting(word: str, compiler: Compile, statement: Statement) -> Action:
            return self.counted(word, compiler(statement))

        return {
            **{word: partial(counting, word, each) for word, each in begin.items()},
            "CF": bare(self._motor.hmt.clear),
            "MU": self._variables.numbers(self._make_up, 1, 2),
        }

    def counted(self, word: str, action: Action) -> Action:
        """Count the motions that an action begins; one that only slows down does not count. No word: as MD says."""
        axis = self._motor.axis

        def move() -> None:
            before, kind = axis.profile, word or self._memory.texts["MD"]
            action()
            profile = axis.profile
            self.begun += profile is not before and (kind != "SL" or profile.end == inf)

        return move

    def _move(self, statement: Statement) -> Action:
        """MA and MR (manual 5.1.80, 5.1.84)."""
        kind, arguments = statement.word, statement.arguments
        if not 1 <= len(arguments) <= 3:
            raise DriveFault(E.ILLEGAL_DATA)
        value = self._variables.value(arguments[0])
        options = [self._variables.value(argument or Number(0)) for argument in arguments[1:]]

        def go() -> None:
            chosen = [whole(option()) for option in options]
            if any(each not in (0, 1) for each in chosen):
                raise DriveFault(E.OUT_OF_RANGE)
            announce, run_on = (*chosen, 0, 0)[:2]
            self._motor.axis.go(kind, whole(value()), self._timeline.now, bool(announce), bool(run_on))
            self._begun(kind)

        return go

    def _slew(self, statement: Statement) -> Action:
        """SL (manual 5.1.117)."""
        value = self._variables.value(only(statement))

        def go() -> None:
            self._motor.slew(whole(value()), self._timeline.now)
            self._begun("SL")

        return go

    def _begun(self, kind: str) -> None:
        self._memory.texts["MD"] = kind
        self._timeline.replan()

    def _home(self, statement: Statement) -> Action:
        """HM, HI, HF. Without a type it is error 81 as for an unknown one."""
        word = statement.word
        if len(statement.arguments) > 1:
            raise DriveFault(E.ILLEGAL_DATA)
        if not statement.arguments:
            raise DriveFault(E.NO_HOMING_TYPE)
        read = self._variables.value(statement.arguments[0])
        return lambda: self._motor.homing.start(word, whole(read()), self._timeline.now)

    def _make_up(self, values: list[int]) -> None:
        """MU: the mode, and 1 to clear lead and lag."""
        mode, clearing = (*values, 0)[:2]
        if mode not in (0, 1, 2) or clearing not in (0, 1):
            raise DriveFault(E.OUT_OF_RANGE)
        self._motor.hmt.make_up(mode, clearing, self._timeline.now)

    def _test(self, statement: Statement) -> Action:
        """SC 1. Raises DriveFault (24) without its number."""
        if not statement.arguments:
            raise DriveFault(E.ILLEGAL_DATA)

        def start(values: list[int]) -> None:
            if values != [1]:
                raise DriveFault(E.OUT_OF_RANGE)
            self._motor.start_test(self._timeline.now)

        return self._variables.numbers(start, 1, 1)(statement)


class Setups:
    """The instructions with several settings, for one drive."""

    def __init__(self, drive: EventLoop, variables: Variables) -> None:
        core, self._variables, self._drive = drive.core, variables, drive
        self._memory, self._program, self._timeline = core.memory, core.program, core.timeline
        self._motor, self._inputs, self._outputs = drive.motor, drive.motor.inputs, drive.output_lines
        self._points = core.model.points

    def commands(self) -> Mapping[str, Compile]:
        numbers = self._variables.numbers
        return {
            "DN": self._device_name,
            "IS": numbers(self._input, 2, 3),
            "OS": numbers(self._outputs.set_up, 2, 3),
            "LS": numbers(self._software_limit, 3, 3),
            "PF": numbers(self._print_format, 1, 4),
            "PW": numbers(partial(self._keep, "PW"), 4, 4),
            **{f"S{n}": self._point(n) for n in self._points.fresh if self._points.shared},
            **{word: partial(self._place_trip, word) for word in TRIPS.keys() - TRIPS_WITH_VALUE},
            **{word: partial(self._value_trip, word) for word in TRIPS_WITH_VALUE},
        }

    # Inputs and outputs.

    def _input(self, values: list[int]) -> None:
        """IS (manual 5.1.64)."""
        was = self._inputs.types.get(values[0], (0, 0))
        self._inputs.set_up(values)
        self._wired(values[0], was)

    def _wired(self, n: int, was: tuple[int, ...]) -> None:
        self._motor.limit_stop.wired(n, was[0], self._timeline.now)
        self._timeline.replan()
        if n in self._inputs.numbers:
            self._drive.wired(n, was)

    def _point(self, n: int) -> Compile:
        """S<n> of an MDrivePlus: type, active level, and of a point that is either, whether it sources."""
        points, fields = self._points, len(self._points.fresh[n])

        def set_up(given: list[int]) -> None:
            values = (*given, 0, 0)[:fields]
            if any(value not in (0, 1) for value in values[1:]):
                raise DriveFault(E.OUT_OF_RANGE)
            was = self._inputs.types[n]
            for clock in points.clocks if n in points.clocks else (n,):
                self._set_point(clock, values)
            self._wired(n, was)

        return self._variables.numbers(set_up, 1 if n == ANALOG else 2, fields)

    def _set_point(self, n: int, values: tuple[int, ...]) -> None:
        """Make a point an input or an output. Raises DriveFault (6, 8, 21)."""
        points, kind, active = self._points, values[0], values[1]
        if kind in points.output_types.get(n, ()):
            if any(values[2:]) and not points.sources:
                raise DriveFault(E.OUT_OF_RANGE)
            self._outputs.set_up([n, kind, active])
        else:
            self._inputs.set_up([n, kind, active])
            self._outputs.release(n)
        self._inputs.types[n] = values

    def _software_limit(self, values: list[int]) -> None:
        """LS; the minus limit must be below the plus limit while both are enabled (manual 5.1.78)."""
        limits, (which, position, enabled) = self._motor.limits.software, values
        if which not in (0, 1) or enabled not in (0, 1) or not -0x80000000 <= position <= 0x7FFFFFFF:
            raise DriveFault(E.OUT_OF_RANGE)
        other, other_enabled = limits[1 - which]
        crossed = position <= other if which else position >= other
        if enabled and other_enabled and crossed:
            raise DriveFault(E.OUT_OF_RANGE)
        change = {which: (position, enabled)}
        self._motor.limit_stop.relocate(lambda: limits.update(change), self._timeline.now)
        self._timeline.replan()

    # Texts.

    def _print_format(self, values: list[int]) -> None:
        """PF (manual 5.1.97). Its default is the format of a new drive, which pads nothing."""
        values = [*values, *PRINT_FORMAT[len(values) :]]
        if not all(0 <= value <= most for value, most in zip(values, MNEMONICS["PF"].setup.numbers[1:], strict=True)):
            raise DriveFault(E.OUT_OF_RANGE)
        self._keep("PF", [] if values == [*PRINT_FORMAT] else values)

    def _keep(self, word: str, values: list[int]) -> None:
        self._memory.texts[word] = ",".join(map(str, values))

    def _device_name(self, statement: Statement) -> Action:
        """DN: a letter or digit, in the forms that the product takes (manual 5.1.33)."""
        if statement.equals and not statement.arguments:  # `DN='a'`: its apostrophe begins a remark
            raise DriveFault(E.OUT_OF_RANGE)
        if len(statement.arguments) != 1:
            raise DriveFault(E.ILLEGAL_DATA if statement.arguments else E.NOT_EXECUTABLE)
        name = device_name_of(statement.arguments[0], not self._memory.model.name_codes)

        def set_up() -> None:
            if not name:
                raise DriveFault(E.OUT_OF_RANGE)
            self._memory.texts["DN"] = name

        return set_up

    # Trips.

    def _place_trip(self, word: str, statement: Statement) -> Action:
        """TC, TM: a place."""
        if not statement.arguments:
            raise missing(statement)
        target = self._target(statement.arguments, 1)
        return lambda: self._define(word, Trip(FIRST_INPUT, target))

    def _value_trip(self, word: str, statement: Statement) -> Action:
        """TI, TP, TT, TR, TA: a value and a place; TR also how often it repeats. TA=0 takes it away."""
        arguments, repeats_too = statement.arguments, word == "TR"
        if not arguments:
            raise missing(statement)
        if word == "TA" and arguments == (Number(0),):
            return lambda: self._motor.trips.forget(TRIPS[word])
        if len(arguments) < 2 and not repeats_too:
            raise DriveFault(E.NO_SEPARATOR)
        value_at, *more = arguments
        target = self._target(more, 2 if repeats_too else 1)
        read = self._variables.value(value_at)
        repeats = self._variables.value(more[1]) if len(more) > 1 else lambda: 0

        def define() -> None:
            value, times = whole(read()), whole(repeats())
            self._check_trip(word, value, times)
            self._define(word, Trip(value, target, times))

        return define

    def _target(self, places: tuple[Argument | None, ...] | list[Argument | None], most: int) -> Argument | None:
        """The subroutine of a trip; None for 0 and for none. Raises DriveFault (24)."""
        if len(places) > most or any(not is_place(place) for place in places[:1]):
            raise DriveFault(E.ILLEGAL_DATA)
        return None if not places or places[0] == Number(0) else places[0]

    def _check_trip(self, word: str, value: int, times: int) -> None:
        """Check what a trip waits for. Raises DriveFault (10, 21)."""
        row = lookup(word, self._memory.product)
        if (row is not None and not row.accepts(value)) or not 0 <= times <= MOST_REPEATS:
            raise DriveFault(E.NO_SUCH_POINT if word == "TI" else E.OUT_OF_RANGE)
        if word == "TI" and value not in self._inputs.numbers:
            raise DriveFault(E.NO_SUCH_POINT)
        if word == "TR" and not value:
            raise DriveFault(E.OUT_OF_RANGE)

    def _define(self, word: str, trip: Trip) -> None:
        if trip.target is not None:
            self._program.check(trip.target)
        self._motor.trips.define(TRIPS[word], trip)
