"""A simulated TMCL module: its motors, global parameters, EEPROM, and the commands of the direct mode.

Rulings where the manuals are silent: a reply's value is the target for MVP REL, and the value of the request for the
other commands that read nothing, refused ones too; global parameters of bank 0 are kept without power, user variables
(bank 2) as STGP stored them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

from multidrop.families.tmcl.manual.commands import (
    FACTORY_CODE,
    AxisParameter,
    Command,
    Global,
    MoveType,
    ProgramStatus,
    SearchAction,
    Status,
    TmclCall,
    Version,
)
from multidrop.families.tmcl.manual.instructions import CONTROL, MEMORY, ProgramWord, Wait
from multidrop.families.tmcl.manual.modules import BAUDS, GLOBAL, TEMPERATURE, VOLTAGE, module_of
from multidrop.families.tmcl.manual.parameters import TARGETS, TmclParameter
from multidrop.families.tmcl.manual.program_file import compiled, read
from multidrop.families.tmcl.simulator.coordinates import EVERY_MOTOR, NUMBERS, Coordinates
from multidrop.families.tmcl.simulator.motor import TmclMotor
from multidrop.families.tmcl.simulator.program import TmclProgram
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World

USER_BANK = 2
DIGITAL, ANALOG, OUTPUTS = 0, 1, 2
"""The banks of GIO; SIO has the last one."""
ALL_PORTS = 255
VOLTS, DEGREES = 240, 25
"""The supply voltage in tenths of a volt and the temperature in degrees Celsius that a module measures."""
EVENTS_AT_ONCE = 100
"""Events of one moment after which time goes on."""
REACHED_INTERRUPT, LEFT_INTERRUPT, RIGHT_INTERRUPT, INPUT_INTERRUPT = 3, 27, 28, 39
"""The first interrupts for a reached target, a left and a right switch of a motor, and an input."""


@dataclass(frozen=True)
class ModuleReply:
    """What the module replies with; `text` or a stored line in place of a frame's fields."""

    status: Status = Status.DONE
    value: int = 0
    text: str = ""
    line: TmclCall | None = None


class ModuleRefusal(Exception):
    """The module refuses a command; nothing was changed."""

    def __init__(self, status: Status) -> None:
        self.status = status


def worlds_of(spec: DriveSpec) -> list[World]:
    """The surroundings of each motor of a module."""
    given = (spec.world, *spec.further)
    return [World(world) for world in (*given, *[WorldSpec()] * (module_of(spec.personality).motors - len(given)))]


class TmclModule:
    """One module, powered up at time 0. `set` of its spec is checked. `baud` is its baud rate if that sets no other."""

    def __init__(self, spec: DriveSpec, worlds: Sequence[World], baud: int = 0) -> None:
        self.table = module_of(spec.personality)
        self.worlds = worlds
        self.powered = False
        self.any_address = spec.any_address
        """It replies to every address, 0 included."""
        self.motors = [TmclMotor(world, self.table) for world in worlds]

        self.program = TmclProgram(self.carry_out, self._waited, self._signals)
        if spec.program:
            name = spec.program_name or "program"
            self.program.load({line.at: line.call for line in compiled(read(spec.program, name))})
        self._version_text = spec.identity.version or self.table.version
        self._notify = 0
        self._notices: list[tuple[float, int]] = []
        self._now = 0.0
        self._watched, self._heard, self._ticks_at = True, 0.0, 0.0
        """The time of the last command of a host; infinite after the heartbeat has stopped the motors."""
        self._outputs = dict.fromkeys(self.table.outputs, 0)
        self._variables: dict[int, int] = {}
        self._fresh()
        self._kept_variables.update({int(number): value for number, value in spec.variables.items()})
        for name, held in spec.set.items():  # `4`, `4_1` for motor 1, `G75`
            number, _, motor = name.partition("_")
            kept, key = (self._axis[int(motor or 0)], number) if name.isdigit() or motor else (self._global, name[1:])
            kept[int(key)] = int(held)  # type: ignore[arg-type]
        self._global[Global.ADDRESS] = int(spec.name)
        if f"G{int(Global.BAUD)}" not in spec.set:
            self._global[Global.BAUD] = next((code for code, each in BAUDS.items() if each == baud), 0)
        self.power(True, 0.0)
        targets = iter(spec.identity.counters.get("target", ()))
        for each, position in zip(self.motors, spec.identity.counters.get("position", ()), strict=False):
            each.stand_at(position, 0.0, next(targets, position))

    def _fresh(self) -> None:
        """Set what EEPROM holds to the factory's values."""
        stored = {number: row.fresh for number, row in self.table.axis.items() if storable(number, row)}
        self._axis = [dict(stored) for _ in self.motors]
        self._global = {number: row.fresh for number, row in {**GLOBAL, **self.table.banks[0]}.items()}
        self._interrupts = dict.fromkeys(self.table.banks[3], 0)
        self._kept_variables: dict[int, int] = {}
        self._coordinates = Coordinates(len(self.motors))

    def __getitem__(self, parameter: Global) -> int:
        return self._global[parameter]

    @property
    def deadline(self) -> float | None:
        """When something next happens by itself."""
        if not self.powered:
            return None
        if self._notices:
            return self._notices[0][0]
        at = self._next_event(self._now)
        return None if at == inf else at

    def notices(self) -> list[tuple[float, int]]:
        """Times and motor masks of targets reached since this was last asked (command 138)."""
        notices, self._notices = self._notices, []
        return notices

    def advance(self, now: float) -> None:
        if not self.powered:
            self._now = max(self._now, now)
            return
        same = 0
        while (at := self._next_event(self._now)) <= now and same < EVENTS_AT_ONCE:
            same = same + 1 if at == self._now else 0
            self._now = at
            self._live(at)
        self._now = max(self._now, now)
        self._live(self._now)

    def execute(self, call: TmclCall, now: float) -> ModuleReply | None:
        """Carry out a command of a host; its reply, or None where it gives none."""
        self.advance(now)
        self._heard = now
        if self.program.storing and call.command < CONTROL:
            return ModuleReply(Status.STORED if self.program.store(call) else Status.MAXIMUM_EXCEEDED, call.value)
        try:
            answer = self._execute(call, now)
        except ModuleRefusal as refused:
            return ModuleReply(refused.status, call.value)
        self._live(now)
        return answer

    def power(self, on: bool, now: float) -> None:
        self.advance(now)
        if on == self.powered:
            return
        self.powered, self._heard = on, now
        self._notify = 0
        self._notices.clear()
        self.program.halt(reset=True)
        self.program.storing = False
        for world, motor, stored in zip(self.worlds, self.motors, self._axis, strict=True):
            if on:
                world.powered_up(now)
                motor.parameters.update(stored)
            motor.power(on, now)
        self._outputs = dict.fromkeys(self._outputs, 0)
        self._variables = dict(self._kept_variables)
        self._coordinates.power_up()
        self._global[Global.TICK_TIMER], self._ticks_at = 0, now
        if on and self._global[Global.AUTOSTART]:
            self.program.run(now)

    def unwatch(self) -> None:
        """Switch the heartbeat off: the twin of a module does not hear what keeps that awake."""
        self._watched = False

    def supply(self, on: bool, now: float) -> None:
        """Do nothing: the module has one supply."""

    def carry_out(self, call: TmclCall, now: float) -> tuple[int, int]:
        """Carry out a command of the direct mode as a line of the program; its status and value."""
        try:
            answer = self._execute(call, now)
        except ModuleRefusal as refused:
            return refused.status, 0
        return Status.DONE, answer.value if answer is not None else 0

    def _waited(self, call: TmclCall, now: float) -> bool:
        """Whether what a WAIT waits for has come."""
        if call.motor >= len(self.motors):
            return True
        motor = self.motors[call.motor]
        home, right, left = motor.shaft.switches(now)
        over: Mapping[int, bool] = {
            Wait.POS: motor.reached(now),
            Wait.REFSW: home,
            Wait.LIMSW: right or left,
            Wait.RFS: motor.search is None,
        }
        return over.get(call.type, True)

    def _signals(self, now: float) -> dict[int, bool]:
        """The states whose beginning is an interrupt, by its number."""
        signals = {INPUT_INTERRUPT + port: bool(level) for port, level in self._inputs(now).items()}
        for n, motor in enumerate(self.motors):
            _, right, left = motor.shaft.switches(now)
            signals[REACHED_INTERRUPT + n] = motor.positioning and motor.reached(now)
            signals |= {LEFT_INTERRUPT + 2 * n: left, RIGHT_INTERRUPT + 2 * n: right}
        return signals

    def _execute(self, call: TmclCall, now: float) -> ModuleReply | None:
        match call.command:
            case Command.VERSION:
                if call.type == Version.TEXT:
                    return ModuleReply(text=self._version_text)
                if (
                    call.type == Version.BINARY
                ):  # the module in the upper half, then both parts of the firmware's number
                    module, _, firmware = self._version_text.partition("V")
                    return ModuleReply(value=int(module) << 16 | int(firmware[0]) << 8 | int(firmware[1:]))
                raise ModuleRefusal(Status.WRONG_TYPE)
            case Command.FACTORY:
                if call.value != FACTORY_CODE:
                    raise ModuleRefusal(Status.INVALID_VALUE)
                self._fresh()
                self.power(False, now)
                self.power(True, now)
                return None
            case Command.SGP | Command.GGP | Command.STGP | Command.RSGP:
                return ModuleReply(value=self._global_parameter(call, now))
            case Command.SIO | Command.GIO:
                return ModuleReply(value=self._port(call, now))
            case ProgramWord.SCO | ProgramWord.GCO | ProgramWord.CCO:
                return ModuleReply(value=self._coordinate(call, now))
        if call.command not in tuple(Command):
            raise ModuleRefusal(Status.INVALID_COMMAND)
        if call.command == Command.READ_PROGRAM:
            if call.value not in range(MEMORY):
                raise ModuleRefusal(Status.INVALID_VALUE)
            return ModuleReply(line=self.program.line(call.value))
        if call.command in range(Command.STOP_PROGRAM, Command.VERSION):
            return ModuleReply(value=self._program_command(call, now))
        if call.command == Command.NOTIFY:  # when motors reach their targets (command 138)
            if call.value not in range(1 << len(self.motors)):
                raise ModuleRefusal(Status.INVALID_VALUE)
            self._notify = call.value
            return ModuleReply(value=call.value)
        if call.motor >= len(self.motors):
            raise ModuleRefusal(self.table.wrong_motor)
        return ModuleReply(value=self._motor_command(self.motors[call.motor], call, now))

    def _program_command(self, call: TmclCall, now: float) -> int:
        program = self.program
        if program.storing and call.command in (Command.RUN, Command.STEP):
            raise ModuleRefusal(Status.NOT_AVAILABLE)
        match call.command:
            case Command.STOP_PROGRAM | Command.RESET_PROGRAM:
                program.halt(reset=call.command == Command.RESET_PROGRAM)
            case Command.RUN:
                program.run(now, call.value if call.type else None)
            case Command.STEP:
                program.step(now)
            case Command.DOWNLOAD:
                program.download(call.value)
            case Command.END_DOWNLOAD:
                program.storing = False
            case Command.PROGRAM_STATUS:
                mode = ProgramStatus.STORES if program.storing else int(program.running)
                place = mode << 24 | int(program.waiting) << 16 | program.counter
                states = (mode, place, program.accumulator, program.x)
                if call.type not in range(len(states)):
                    raise ModuleRefusal(Status.WRONG_TYPE)
                return states[call.type]
        return call.value

    def _motor_command(self, motor: TmclMotor, call: TmclCall, now: float) -> int:
        """Carry out a command for a motor; the value of its reply."""
        match call.command:
            case Command.ROR | Command.ROL:
                velocity = call.value if call.command == Command.ROR else -call.value
                self._start(motor, AxisParameter.TARGET_VELOCITY, velocity, now)
            case Command.MST:
                self._start(motor, AxisParameter.TARGET_VELOCITY, 0, now)
            case Command.MVP:
                if call.type not in tuple(MoveType):
                    raise ModuleRefusal(Status.WRONG_TYPE)
                if call.type == MoveType.COORD and call.value not in NUMBERS:
                    raise ModuleRefusal(Status.INVALID_VALUE)
                motor.end_search()
                if call.type == MoveType.COORD:
                    motor.go(self._coordinates.of(call.motor, call.value), now)
                    return call.value
                if call.type == MoveType.REL:
                    motor.go_by(call.value, now)
                    return motor.read(AxisParameter.TARGET_POSITION, now)
                motor.go(call.value, now)
            case Command.RFS if call.type not in tuple(SearchAction):
                raise ModuleRefusal(Status.WRONG_TYPE)
            case Command.RFS if call.type == SearchAction.STATUS:
                return motor.search.number if motor.search is not None else 0
            case Command.RFS if call.type == SearchAction.START:
                motor.seek(now)
            case Command.RFS if motor.search is not None:
                motor.end_search()
                motor.rotate(0, now)
            case Command.RFS:
                pass
            case _:
                return self._axis_parameter(motor, call, now)
        return call.value

    def _coordinate(self, call: TmclCall, now: float) -> int:
        """Set, read or take a coordinate; motor 255 of SCO and GCO: copy from or to EEPROM."""
        if call.type not in NUMBERS:
            raise ModuleRefusal(Status.WRONG_TYPE)
        if call.motor == EVERY_MOTOR and call.command == ProgramWord.SCO:
            self._coordinates.restore(call.type)
            return call.value
        if call.motor == EVERY_MOTOR and call.command == ProgramWord.GCO:
            self._coordinates.keep(call.type)
            return call.value
        if call.motor >= len(self.motors):
            raise ModuleRefusal(self.table.wrong_motor)
        if call.command == ProgramWord.GCO:
            return self._coordinates.of(call.motor, call.type)
        position = call.value if call.command == ProgramWord.SCO else self.motors[call.motor].position(now)
        self._coordinates.set(call.motor, call.type, position, lasting=bool(self._global.get(Global.COORDINATES)))
        return call.value

    def _start(self, motor: TmclMotor, parameter: AxisParameter, value: int, now: float) -> None:
        """Set a parameter that starts a motion; it ends a reference search."""
        _in_range(self.table.axis[parameter], value)
        motor.end_search()
        motor.write(parameter, value, now)

    def _axis_parameter(self, motor: TmclMotor, call: TmclCall, now: float) -> int:
        row = self.table.axis.get(call.type)
        if row is None:
            raise ModuleRefusal(Status.WRONG_TYPE)
        match call.command:
            case Command.GAP:
                return motor.read(call.type, now)
            case Command.SAP:
                if not row.writable:
                    raise ModuleRefusal(Status.WRONG_TYPE)
                _in_range(row, call.value)
                if call.type in TARGETS:
                    motor.end_search()
                motor.write(call.type, call.value, now)
                return call.value
        if not storable(call.type, row):
            raise ModuleRefusal(Status.WRONG_TYPE)
        stored = self._axis[call.motor]
        if call.command == Command.STAP:
            stored[call.type] = motor.parameters[call.type]
        else:
            motor.write(call.type, stored[call.type], now)
        return call.value

    def _global_parameter(self, call: TmclCall, now: float) -> int:
        if call.motor > max(self.table.banks):
            raise ModuleRefusal(Status.INVALID_VALUE)
        row = self.table.banks.get(call.motor, {}).get(call.type)
        if row is None or (call.command == Command.SGP and not row.writable):
            raise ModuleRefusal(Status.WRONG_TYPE)
        held = {0: self._global, USER_BANK: self._variables}.get(call.motor, self._interrupts)
        match call.command:
            case Command.SGP:
                _in_range(row, call.value)
                held[call.type] = call.value
                if (call.motor, call.type) == (0, Global.TICK_TIMER):
                    self._ticks_at = now
            case Command.GGP if (call.motor, call.type) == (0, Global.TICK_TIMER):
                return _wrapped(held[call.type] + int((now - self._ticks_at) * 1000))
            case Command.GGP if call.motor == 0 and not row.writable:  # the program's state
                states = {Global.PROGRAM_STATUS: self.program.running, Global.DOWNLOAD_MODE: self.program.storing}
                return int(states.get(Global(call.type), self.program.counter))
            case Command.GGP:
                return held.get(call.type, 0)
            case Command.STGP if call.motor == USER_BANK:
                self._kept_variables[call.type] = held.get(call.type, 0)
            case Command.RSGP if call.motor == USER_BANK:
                held[call.type] = self._kept_variables.get(call.type, 0)
        return call.value

    def _port(self, call: TmclCall, now: float) -> int:
        """Set an output, or read a port."""
        if call.motor not in (DIGITAL, ANALOG, OUTPUTS) or (call.command == Command.SIO and call.motor != OUTPUTS):
            raise ModuleRefusal(Status.INVALID_VALUE)
        if call.motor == ANALOG:
            if call.type not in self.table.analog:
                raise ModuleRefusal(Status.WRONG_TYPE)
            if call.type in (VOLTAGE, TEMPERATURE):
                return VOLTS if call.type == VOLTAGE else DEGREES
            return self.worlds[self.table.analog.index(call.type)].analog(now)
        ports = self._outputs if call.motor == OUTPUTS else self._inputs(now)
        if call.type == ALL_PORTS:
            if call.command == Command.GIO:
                return sum(level << port for port, level in ports.items())
            self._outputs = {port: call.value >> port & 1 for port in ports}
            return call.value
        if call.type not in ports:
            raise ModuleRefusal(Status.WRONG_TYPE)
        if call.command == Command.GIO:
            return ports[call.type]
        _in_range(OUTPUT, call.value)
        self._outputs[call.type] = call.value
        return call.value

    def _inputs(self, now: float) -> Mapping[int, int]:
        """Digital inputs, by port; port n is input n + 1 of the world."""
        return {port: int(any(world.level(port + 1, now) for world in self.worlds)) for port in self.table.inputs}

    def _next_event(self, after: float) -> float:
        events = [at for motor in self.motors for at in motor.events(after)]
        if self.program.running:  # an input may be an interrupt
            events += [world.next_change(after) for world in self.worlds]
        return min((at for at in (*events, self.program.due, self._silent_at) if at > after), default=inf)

    @property
    def _silent_at(self) -> float:
        """When the heartbeat (global parameter 68) stops the motors; infinite: never."""
        return self._heard + (self._watched * self._global[Global.HEARTBEAT] / 1000 or inf)

    def _live(self, t: float) -> None:
        if not self.powered:
            return
        if self._silent_at <= t:
            self._heard = inf
            for motor in self.motors:
                if motor.moving(t) or motor.search is not None:
                    motor.end_search()
                    motor.rotate(0, t)
        for n, motor in enumerate(self.motors):
            motor.live(t)
            if self._notify >> n & 1 and motor.positioning and motor.reached(t):
                self._notices.append((t, 1 << n))
                self._notify &= ~(1 << n)
        self.program.live(t)


OUTPUT = TmclParameter("level of an output", range(2))


def storable(number: int, row: TmclParameter) -> bool:
    """Whether EEPROM holds an axis parameter."""
    return row.writable and number > AxisParameter.TARGET_VELOCITY


def _in_range(row: TmclParameter, value: int) -> None:
    if value not in row.limits:
        raise ModuleRefusal(Status.INVALID_VALUE)


def _wrapped(value: int) -> int:
    """A value as 32 bits hold it, with its sign."""
    return (value + (1 << 31)) % (1 << 32) - (1 << 31)
