"""A simulated TMCL module: one motor, global parameters, EEPROM, the commands of the direct mode, and its port.

Rulings where the manuals are silent: a reply's value is the target for MVP and the value of the request for the other
commands that set something; global parameters are kept without power; the module is a TMCM-1241 by its version.

The port takes nine bytes and sends nine bytes. A request for another address gets no reply. Framing is by count; the
module drops an unfinished message after a pause. Ruling: the pause is 0.5 s; the manuals give none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from struct import Struct

from multidrop.dialects.tmcl.manual.commands import (
    AXIS,
    BAUDS,
    FACTORY_CODE,
    GLOBAL,
    Axis,
    Call,
    Command,
    Global,
    Move,
    Parameter,
    Running,
    Search,
    Status,
    Version,
)
from multidrop.dialects.tmcl.manual.instructions import CONTROL, MEMORY, Wait
from multidrop.dialects.tmcl.manual.program_file import compiled, read
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.tmcl.motor import STORED, Motor, Phase, ReferenceSearch
from multidrop.simulator.tmcl.program import Program
from multidrop.simulator.wire import Port, Transmission
from multidrop.simulator.world import World

VERSION = "1241V115"
BANK = 0
EVENTS_AT_ONCE = 100
"""Events of one moment after which time goes on."""
REACHED_INTERRUPT, LEFT_INTERRUPT, RIGHT_INTERRUPT = 3, 27, 28
"""The interrupts of motor 0: target reached, left switch, right switch."""


@dataclass(frozen=True)
class Answer:
    """What the module replies with; `text` or a stored line in place of a frame's fields."""

    status: Status = Status.DONE
    value: int = 0
    text: str = ""
    line: Call | None = None


class Refused(Exception):
    """The module refuses a command; nothing was changed."""

    def __init__(self, status: Status) -> None:
        self.status = status


class TmclModule:
    """One module, powered up at time 0. `set` of its spec is checked. `baud` is its baud rate if that sets no other."""

    def __init__(self, spec: DriveSpec, world: World, baud: int = 0) -> None:
        position = spec.identity.counters.get("position", (0,))[0]
        axis = {int(name): int(value) for name, value in spec.set.items() if name.isdigit()}  # type: ignore[arg-type]
        module = {int(name[1:]): int(value) for name, value in spec.set.items() if not name.isdigit()}  # type: ignore[arg-type]
        self.world = world
        self._version_text = spec.identity.version or VERSION
        self.powered = False
        self.motor = Motor(world)

        self.program = Program(self.carry_out, self._waited, self._signals)
        if spec.program:
            name = spec.program_name or "program"
            self.program.load({each.at: each.call for each in compiled(read(spec.program, name))})
        self._search: ReferenceSearch | None = None
        self._notify = 0
        self._notices: list[tuple[float, int]] = []
        self._now = 0.0
        self._axis = {number: AXIS[number].fresh for number in STORED} | axis
        code = next((code for code, each in BAUDS.items() if each == baud), 0)
        self._global = {number: row.fresh for number, row in GLOBAL.items()}
        self._global |= {Global.BAUD: code, **module, Global.ADDRESS: int(spec.name)}
        self.power(True, 0.0)
        self.motor.stand_at(position, 0.0)

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
        """Live up to `now`."""
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

    def execute(self, call: Call, now: float) -> Answer | None:
        """Carry out a command of a host; its reply, or None where it gives none."""
        self.advance(now)
        if self.program.storing and call.command < CONTROL:
            return Answer(Status.STORED if self.program.store(call) else Status.MAXIMUM_EXCEEDED, call.value)
        try:
            answer = self._execute(call, now)
        except Refused as refused:
            return Answer(refused.status)
        self._live(now)
        return answer

    def power(self, on: bool, now: float) -> None:
        self.advance(now)
        if on == self.powered:
            return
        self.powered = on
        self._search, self._notify = None, 0
        self._notices.clear()
        self.program.halt(reset=True)
        self.program.storing = False
        if on:
            self.world.powered_up(now)
            self.motor.parameters.update(self._axis)
        self.motor.power(on, now)
        if on and self._global[Global.AUTOSTART]:
            self.program.run(now)

    def supply(self, on: bool, now: float) -> None:
        """Do nothing: the module has one supply."""

    def world_changed(self) -> None:
        """Do nothing: `advance` looks at all of the world."""

    def carry_out(self, call: Call, now: float) -> tuple[int, int]:
        """Carry out a command of the direct mode as a line of the program; its status and value."""
        try:
            answer = self._execute(call, now)
        except Refused as refused:
            return refused.status, 0
        return Status.DONE, answer.value if answer is not None else 0

    def _waited(self, call: Call, now: float) -> bool:
        """Whether what a WAIT waits for has come."""
        home, right, left = self.motor.shaft.switches(now)
        over: Mapping[int, bool] = {
            Wait.POS: self.motor.reached(now),
            Wait.REFSW: home,
            Wait.LIMSW: right or left,
            Wait.RFS: self._search is None,
        }
        return over.get(call.type, True)

    def _signals(self, now: float) -> dict[int, bool]:
        """The states whose beginning is an interrupt, by its number."""
        _, right, left = self.motor.shaft.switches(now)
        reached = self.motor.positioning and self.motor.reached(now)
        return {REACHED_INTERRUPT: reached, LEFT_INTERRUPT: left, RIGHT_INTERRUPT: right}

    def _execute(self, call: Call, now: float) -> Answer | None:
        match call.command:
            case Command.VERSION:
                if call.type == Version.TEXT:
                    return Answer(text=self._version_text)
                if call.type == Version.BINARY:
                    return Answer(value=_number_of(self._version_text))
                raise Refused(Status.WRONG_TYPE)
            case Command.FACTORY:
                if call.value != FACTORY_CODE:
                    raise Refused(Status.INVALID_VALUE)
                self._axis = {number: AXIS[number].fresh for number in STORED}
                self._global = {number: row.fresh for number, row in GLOBAL.items()}
                self.power(False, now)
                self.power(True, now)
                return None
            case Command.SGP | Command.GGP | Command.STGP | Command.RSGP:
                return Answer(value=self._global_parameter(call))
        if call.command not in tuple(Command):
            raise Refused(Status.INVALID_COMMAND)
        if call.command == Command.READ_PROGRAM:
            if call.value not in range(MEMORY):
                raise Refused(Status.INVALID_VALUE)
            return Answer(line=self.program.line(call.value))
        if call.command in range(Command.STOP_PROGRAM, Command.VERSION):
            return Answer(value=self._program_command(call, now))
        if call.command == Command.NOTIFY:  # when the motor reaches its target (command 138)
            if call.value not in (0, 1):
                raise Refused(Status.INVALID_VALUE)
            self._notify = call.value
            return Answer(value=call.value)
        if call.motor != 0:
            raise Refused(Status.INVALID_VALUE)
        return Answer(value=self._motor_command(call, now))

    def _program_command(self, call: Call, now: float) -> int:
        program = self.program
        if program.storing and call.command in (Command.RUN, Command.STEP):
            raise Refused(Status.NOT_AVAILABLE)
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
                mode = Running.STORES if program.storing else int(program.running)
                place = mode << 24 | int(program.waiting) << 16 | program.counter
                states = (mode, place, program.accumulator, program.x)
                if call.type not in range(len(states)):
                    raise Refused(Status.WRONG_TYPE)
                return states[call.type]
        return call.value

    def _motor_command(self, call: Call, now: float) -> int:
        match call.command:
            case Command.ROR | Command.ROL:
                velocity = call.value if call.command == Command.ROR else -call.value
                self._start(Axis.TARGET_VELOCITY, velocity, now)
            case Command.MST:
                self._start(Axis.TARGET_VELOCITY, 0, now)
            case Command.MVP:
                return self._move(call, now)
            case Command.RFS:
                return self._reference(call, now)
            case _:
                return self._axis_parameter(call, now)
        return call.value

    def _start(self, parameter: Axis, value: int, now: float) -> None:
        """Set a parameter that starts a motion; it ends a reference search."""
        _in_range(AXIS[parameter], value)
        self._search = None
        self.motor.write(parameter, value, now)

    def _move(self, call: Call, now: float) -> int:
        if call.type not in (Move.ABS, Move.REL):
            raise Refused(Status.WRONG_TYPE)
        self._search = None
        if call.type == Move.ABS:
            self.motor.go(call.value, now)
        else:
            self.motor.go_by(call.value, now)
        return self.motor.read(Axis.TARGET_POSITION, now)

    def _reference(self, call: Call, now: float) -> int:
        if call.type not in tuple(Search):
            raise Refused(Status.WRONG_TYPE)
        if call.type == Search.STATUS:
            return int(self._search is not None)
        if call.type == Search.START:
            self._search = ReferenceSearch(self.motor, self.motor.parameters[Axis.SEARCH_MODE], now)
        elif self._search is not None:
            self._search = None
            self.motor.rotate(0, now)
        return 0

    def _axis_parameter(self, call: Call, now: float) -> int:
        row = AXIS.get(call.type)
        if row is None:
            raise Refused(Status.WRONG_TYPE)
        match call.command:
            case Command.GAP:
                return self.motor.read(call.type, now)
            case Command.SAP:
                if not row.writable:
                    raise Refused(Status.WRONG_TYPE)
                _in_range(row, call.value)
                if call.type in STARTERS:
                    self._search = None
                self.motor.write(call.type, call.value, now)
                return call.value
        if call.type not in self._axis:
            raise Refused(Status.WRONG_TYPE)
        if call.command == Command.STAP:
            self._axis[call.type] = self.motor.parameters[call.type]
        else:
            self.motor.write(call.type, self._axis[call.type], now)
        return 0

    def _global_parameter(self, call: Call) -> int:
        if call.motor != BANK:
            raise Refused(Status.INVALID_VALUE)
        states = (int(self.program.running), int(self.program.storing), self.program.counter)
        if call.type in range(Global.PROGRAM_STATUS, Global.PROGRAM_STATUS + len(states)):
            if call.command != Command.GGP:
                raise Refused(Status.WRONG_TYPE)
            return states[call.type - Global.PROGRAM_STATUS]
        row = GLOBAL.get(call.type)
        if row is None:
            raise Refused(Status.WRONG_TYPE)
        if call.command == Command.SGP:
            _in_range(row, call.value)
            self._global[call.type] = call.value
            return call.value
        return self._global[call.type] if call.command == Command.GGP else 0

    def _next_event(self, after: float) -> float:
        return min((at for at in (*self.motor.events(after), self.program.due) if at > after), default=inf)

    def _live(self, t: float) -> None:
        if not self.powered:
            return
        if self._search is None:
            self.motor.live(t)
        else:
            self.motor.shaft.settle(t)
            self._search.live(t)
            if self._search.phase is Phase.DONE:
                self._search = None
        if self._notify and self.motor.positioning and self.motor.reached(t):
            self._notices.append((t, self._notify))
            self._notify = 0
        self.program.live(t)


STARTERS = frozenset({Axis.TARGET_POSITION, Axis.TARGET_VELOCITY})


def _number_of(version: str) -> int:
    """The binary form of `1241V115`: the module in the upper half, then both parts of the firmware's number."""
    module, _, firmware = version.partition("V")
    return int(module) << 16 | int(firmware[0]) << 8 | int(firmware[1:])


def _in_range(row: Parameter, value: int) -> None:
    if value not in row.limits:
        raise Refused(Status.INVALID_VALUE)


LENGTH = 9
PAUSE = 0.5
"""Seconds of silence after which an unfinished message is dropped."""
REQUEST = Struct(">BBBBi")
REPLY = Struct(">BBBBi")


class TmclPort(Port):
    """The serial port of one module. `any_baud`: the wire has no baud rate that the module can be set to."""

    def __init__(self, device: TmclModule, *, any_baud: bool = True) -> None:
        self._device = device
        self._any_baud = any_baud
        self._message = bytearray()
        self._heard_at = 0.0
        self._out: list[Transmission] = []

    @property
    def baud(self) -> int:
        return 0 if self._any_baud else BAUDS.get(self._device[Global.BAUD], 0)

    @property
    def deadline(self) -> float | None:
        times = (self._device.deadline, *(each.at for each in self._out))
        return min((at for at in times if at is not None), default=None)

    def receive(self, data: bytes, now: float) -> None:
        if not self._device.powered:
            self._message.clear()
            return
        if now - self._heard_at > PAUSE:
            self._message.clear()
        self._heard_at = now
        for byte in data:
            self._message.append(byte)
            if len(self._message) == LENGTH:
                message = bytes(self._message)
                self._message.clear()
                self._take(message, now)

    def sent(self, now: float) -> list[Transmission]:
        self._device.advance(now)
        for at, motors in self._device.notices():
            self._say(at, self._frame(Status.TARGET_REACHED, Command.NOTIFY, motors))
        due = [each for each in self._out if each.at <= now]
        self._out = [each for each in self._out if each.at > now]
        return due

    def _take(self, message: bytes, now: float) -> None:
        address, command, kind, motor, value = REQUEST.unpack(message[:-1])
        if address != self._device[Global.ADDRESS]:
            return
        self._device.advance(now)
        host = self._device[Global.HOST_ADDRESS]
        if sum(message[:-1]) % 256 != message[-1]:
            self._say(now, self._frame(Status.WRONG_CHECKSUM, command, 0))
            return
        answer = self._device.execute(Call(command, kind, motor, value), now)
        if answer is None:
            return
        if answer.text:
            self._say(now, bytes([host]) + answer.text.encode("ascii"))
        elif answer.line is not None:
            line = answer.line
            self._say(now, self._frame(line.type, line.motor, line.value, line.command, host))
        else:
            self._say(now, self._frame(answer.status, command, answer.value, address, host))

    def _frame(
        self, status: int, command: int, value: int, address: int | None = None, host: int | None = None
    ) -> bytes:
        """One reply; it names the address that the request was for, also where that has just been changed."""
        host = self._device[Global.HOST_ADDRESS] if host is None else host
        address = self._device[Global.ADDRESS] if address is None else address
        body = REPLY.pack(host, address, status, command, value)
        return body + bytes([sum(body) % 256])

    def _say(self, at: float, data: bytes) -> None:
        self._out.append(Transmission(at + self._device[Global.PAUSE] / 1000, data))
