"""A simulated MCode drive: its state, power, memory that lasts, and the lines that it is sent.

Theory of operation. The device is one thread of virtual time. `advance(now)` works out the horizon, the next thing that
happens whatever the program does (the end of a motion, a trip, an input, the end of a hold), lets the interpreter run
up to it, lets it happen, and goes on until `now`. `execute` carries out one line at once, between two lines of the
program. Nothing here reads a clock; the port in front of a device deals with echo, prompts and checksums.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import inf, nextafter
from typing import NamedTuple

import simulator.lexium.motion.reactions as reactions
import simulator.lexium.nvm as nonvolatile
import simulator.lexium.power as power
from dialects.mcode.manual.grammar import LineError, Statement, parse, strip
from simulator.cell.spec import DriveSpec
from simulator.lexium.language.flow import new_label
from simulator.lexium.language.instructions import compile_statement
from simulator.lexium.language.interpreter import Action, Interpreter
from simulator.lexium.motion.axis import Axis
from simulator.lexium.motion.inputs import HOME, Inputs
from simulator.lexium.motion.limits import WAYS
from simulator.lexium.motion.motor import Motor
from simulator.lexium.motion.outputs import Outputs
from simulator.lexium.motion.trips import Trips
from simulator.lexium.state.comm_settings import PortSettings
from simulator.lexium.state.errors import Failure, Fault
from simulator.lexium.state.memory import Memory, Store
from simulator.lexium.state.models import Model
from simulator.lexium.state.program_memory import Program
from simulator.world import World

MOVING_SAVE, MOVING_CLEAR = 73, 74
CRLF = "\r\n"
BITS_A_BYTE, TRANSMIT_BUFFER = 10, 256
"""The transmitter of a drive: bits on the wire for a byte, bytes that wait to be sent (not in the manual)."""
SHORTEST_US = 1.0
"""No line takes less, so that a loop always ends at some time."""
taken_apart = lru_cache(maxsize=1024)(parse)
"""Clients that watch a drive send the same few lines again and again."""


class Answer(NamedTuple):
    """What a line printed: whole lines, what a PR that ends in a semicolon left, and whether it was refused."""

    lines: tuple[str, ...] = ()
    tail: str = ""
    refused: bool = False


class MCodeDevice(PortSettings):
    """One drive. Times are seconds and never go back. Raises Diagnostic for a spec that it cannot be set up with."""

    now: float
    world: World
    memory: Memory
    program: Program
    model: Model
    axis: Axis
    motor: Motor
    inputs: Inputs
    output_lines: Outputs
    trips: Trips
    interpreter: Interpreter
    limits: dict[int, tuple[int, ...]]
    nvm: Store
    spec: DriveSpec

    def __init__(self, spec: DriveSpec, world: World) -> None:
        self.spec, self.world, self.product = spec, world, spec.personality
        self.now = 0.0
        self.stale = True
        self.immediate = False
        self.programming: int | None = None
        self.pending = ""
        self.jogging = 0
        self.failures: list[Failure] | None = None
        self.moves = 0
        self._in_line = False
        self._calm = False
        self._heard: tuple[bool, bool, int] | None = None
        self.limits = {0: (0, 0), 1: (0, 0)}
        self.powered = True
        self.boots_at: float | None = None
        self.boots = 0
        self.baud = 9600
        self._sending_until = 0.0
        self.memory = Memory(self.product)
        self.model = self.memory.model
        self.program = Program(product=self.product)
        self.axis = Axis(self.memory, world)
        self.inputs = Inputs(self.memory, world, self.axis)
        self.output_lines = Outputs(self)
        self.inputs.put_out = self.output_lines.put_out
        self.trips = Trips(self)
        self.motor = Motor(self)
        self.interpreter = Interpreter(self, max(spec.instruction_us, SHORTEST_US) / 1e6)
        self.nvm = Store(program=self.program)
        self._out: list[str] = []
        self._printed: list[tuple[float, str]] = []
        self._horizon: tuple[float, Callable[[], None]] = (inf, self._nothing)
        nonvolatile.equip(self)
        nonvolatile.boot(self)

    @property
    def running(self) -> bool:
        """BY."""
        return self.interpreter.running

    @property
    def stepping(self) -> bool:
        """Whether a program is executed step by step, and waits for keys."""
        return self.interpreter.stepping

    def position(self, now: float) -> int:
        """P at a time not before the last one."""
        return self.axis.counter(self.axis.source, now)

    def velocity(self, now: float) -> int:
        """V, likewise."""
        return self.axis.speed(now)

    def moving(self, now: float) -> bool:
        """MV, likewise."""
        return self.axis.reported(now)

    def outputs(self, now: float) -> dict[int, bool]:
        """Which outputs are active, by number, likewise."""
        return {n: self.output_lines.active(n, now) for n in self.output_lines.types}

    # Time.

    def proceed(self, now: float) -> float | None:
        """Let time pass up to `now`, or to where there is something to tell; gives when that is, None for nothing.

        That is a print, the start or end of a program, power that goes, a new beginning.
        """
        self._heard = self._state()
        self.advance(now)
        told, self._heard = self._news(), None
        return self.now if told else None

    def advance(self, now: float, *, program: bool = False) -> None:
        """Let everything happen that is due up to `now`, in the order of its times.

        `program`: but stop when no program runs any more; `self.now` is then when it ended.
        """
        self._calm = False
        while self.powered or self._boots(now):
            if self._news() or not self._live(now, program):
                return
            self.now = max(self.now, now)
            if not self._look():
                break
        self.now = max(self.now, now)

    @property
    def deadline(self) -> float | None:
        """When something next happens by itself; None if nothing will."""
        if not self.powered:
            return self.boots_at
        if self.stale:
            self._plan()
        due = min(self._horizon[0], self.interpreter.due)
        return None if due == inf else max(due, self.now)

    def quiet(self, now: float, running: bool) -> bool:
        """Whether there is nothing to tell of it up to `now`, if it was `running` before. Quick to ask.

        It has power and has printed nothing, nothing happens by itself, and its program has neither begun nor ended.
        """
        if self.stale or self._printed or not self.powered or self._horizon[0] <= now:
            return False
        interpreter = self.interpreter
        return interpreter.running == running and (not interpreter.live or interpreter.next_at > now)

    def _boots(self, now: float) -> bool:
        """Whether it has come up by now."""
        if self.boots_at is None or self.boots_at > now:
            return False
        self.now = max(self.now, self.boots_at)
        power.come_up(self)
        return True

    def _live(self, now: float, program: bool) -> bool:
        while not program or self.interpreter.running:
            if self.stale:
                self._plan()
            at, event = self._horizon
            self._in_line = True
            self.interpreter.run(nextafter(at, -inf) if at <= now else now)
            self._in_line = False
            if self._news():
                break
            if self.stale:
                continue
            if at > now:
                return True
            self.now = max(self.now, at)
            self.stale = True
            event()
            if self._news():
                break
        return False

    def _state(self) -> tuple[bool, bool, int]:
        return self.interpreter.running, self.powered, self.boots

    def _news(self) -> bool:
        """Whether somebody waits for what there is to tell, and there is something."""
        return self._heard is not None and (bool(self._printed) or self._state() != self._heard)

    def _plan(self) -> None:
        """Work out what happens next whatever the program does."""
        self.stale = False
        self._look()
        now = self.now
        tripped, bit = self.trips.next(now)
        moved, moves = self.motor.next(now)
        self._horizon = min(
            (tripped, lambda: self.trips.fire(bit, self.now)),
            (moved, lambda: moves(self.now)),
            (self.interpreter.wakes_at(), lambda: self.interpreter.wake(self.now)),
            (self.inputs.next_change(now), self._nothing),
            key=lambda each: each[0],
        )

    def _nothing(self) -> None:
        """An input has changed: the next plan begins with a look at all of them."""

    def _look(self) -> bool:
        """Act on inputs that have become active. Gives whether anything has changed."""
        risen, fallen = self.inputs.refresh(self.now)
        self.motor.look(self.now)
        limited = not self.memory.values.get("CM")  # a clock knows no limits (5-13)
        self.axis.blocked = {WAYS[kind] for kind in self.inputs.active_types() if limited and kind in WAYS}
        for n in risen:
            kind = self.inputs.types[n][0]
            self.trips.input(n, self.now, kind == self.inputs.points.capture)
            if kind in WAYS and limited:
                self.motor.limits.reach(WAYS[kind], self.now)
            elif kind == HOME:
                self.motor.homing.home(True, self.now)
            else:
                reactions.risen(self, kind)
        for n in fallen:
            if self.inputs.types[n][0] == HOME:
                self.motor.homing.home(False, self.now)
            reactions.fallen(self, self.inputs.types[n][0])
        self.stale = self.stale or bool(risen or fallen)
        return bool(risen or fallen)

    # Lines.

    def execute(self, text: str, now: float) -> Answer:
        """Carry out one line, or store it in program mode. Never raises, whatever the text."""
        if self._calm and self.quiet(now, self.interpreter.running):
            self.now = max(self.now, now)
        else:
            self.advance(now)
        if not self.powered:
            return Answer(refused=True)
        self._out, self.immediate, self._calm = [], True, False
        refused = False
        try:
            self._carry_out(text)
        except LineError as error:
            refused = self._refuse(error.code)
        except Fault as fault:
            refused = self._refuse(fault.code)
        finally:
            self.immediate = False
        *lines, tail = "".join(self._out).split(CRLF)
        return Answer(tuple(lines), tail, refused)

    def _carry_out(self, text: str) -> None:
        statement = taken_apart(text, frozenset((*self.memory.scopes, *self.program.labels, *self.program.declared)))
        if statement is None:
            return
        if self.programming is None:
            compile_statement(self, statement, stored=False)()
            self._calm = statement.word == "PR"  # which changes nothing that there is to look at
        elif statement.word == "PG" and not statement.arguments:
            self.programming = None
        else:
            self._store(statement, strip(text))

    def _store(self, statement: Statement, text: str) -> None:
        """One more line of the program, if it can be one."""
        address = self.programming or 0
        compile_statement(self, statement, stored=True)
        name = new_label(self, statement) if statement.word == "LB" else ""
        self.programming = self.program.store(address, text, statement)
        if name:
            self.program.labels[name] = address
        self.program_changed()
        self.interpreter.forget()

    def program_changed(self) -> None:
        """Program memory is other than before; some products keep it at once, without S."""
        if self.model.lasting_programs:
            self.nvm.program = self.program

    def compile_line(self, statement: Statement) -> Action:
        """The action of a stored line; one that cannot be carried out any more is an error when it is reached."""
        try:
            return compile_statement(self, statement, stored=True)
        except Fault as fault:
            code, fatal = fault.code, fault.fatal

            def refuse() -> None:
                raise Fault(code, fatal)

            return refuse

    def emit(self, text: str) -> None:
        """Print: into the answer of an immediate line, else as something printed by itself."""
        if self.immediate:
            self._out.append(text)
        else:
            self.announce(text)

    def announce(self, text: str) -> None:
        """Print by itself, whatever asked for it."""
        self._printed.append((self.now, text))
        if self.model.waits_to_print:
            self._wait_to_print(len(text))
        self.stale = self.stale or self._heard is not None

    def _wait_to_print(self, count: int) -> None:
        """Hold the program up until what has been printed fits into the transmitter's buffer."""
        byte = BITS_A_BYTE / self.baud
        self._sending_until = max(self._sending_until, self.now) + count * byte
        if self.interpreter.live:
            self.interpreter.next_at = max(self.interpreter.next_at, self._sending_until - TRANSMIT_BUFFER * byte)

    def prints(self) -> list[tuple[float, str]]:
        """What was printed by itself since this was last asked, with the times."""
        printed, self._printed = self._printed, []
        return printed

    # Errors.

    def fail(self, code: int, now: float) -> None:
        """An error that the port has found, such as a line that is too long."""
        self.advance(now)
        self._refuse(code)

    def _refuse(self, code: int) -> bool:
        self.set_error(code)
        if self.programming is None:
            self.interpreter.on_error(self.now)
        return True

    def set_error(self, code: int) -> None:
        """Put a code into ER and set EF."""
        code = self.model.codes.get(code, code)
        self.memory.values["ER"], self.memory.values["EF"] = code, 1
        if self.failures is not None:
            self.failures.append(Failure(self.now, code, self.line))

    def raise_error(self, code: int) -> None:
        """An error that no line has caused: the register, the flag, and the handler."""
        self.set_error(code)
        self.interpreter.on_error(self.now)
        self.stale = True

    def handled(self) -> None:
        """The subroutine of OE is called for what has just failed."""
        for each in self.failures or ():
            each.handled = each.handled or each.t == self.now

    @property
    def line(self) -> int:
        """The line of the program that is at work or holds; between two lines, the next one."""
        interpreter = self.interpreter
        holding = interpreter.waiting or interpreter.next_at > self.now + interpreter.period
        return interpreter.pc - (self._in_line or holding)

    def clear_error(self) -> None:
        """Clear ER and EF."""
        self.memory.values["ER"], self.memory.values["EF"] = 0, 0

    # Keys and power.

    def escape(self, now: float) -> None:
        """ESC or ^E: motor and program stop at once, without a ramp (manual 3.4.4)."""
        self.advance(now)
        self.motor.hmt.halt()
        self.motor.stop(self.now)
        self.interpreter.finish()
        self.stale = True

    def step(self, key: str, now: float) -> None:
        """A key of single step: space or carriage return."""
        self.advance(now)
        self.interpreter.step(key, self.now)

    def reset(self, now: float) -> None:
        """^C: begin anew with what NVM holds (manual 3.4.4)."""
        self.advance(now)
        if self.powered:
            self.restart()

    def restart(self) -> None:
        """The same now, for an input of that type."""
        power.restart(self)

    def power(self, on: bool, now: float) -> None:
        """Switch the drive on or off. What NVM holds stays."""
        self.advance(now)
        power.switch(self, on)

    def supply(self, on: bool, now: float) -> None:
        """Switch +V alone, with the auxiliary supply left on (manual 5.1.127)."""
        self.advance(now)
        power.supply(self, on)

    def world_changed(self) -> None:
        """Look at the world again: `/sim` has changed it."""
        self.stale = True

    # Memory that lasts.

    def save(self) -> None:
        """S. Raises Fault (73)."""
        if self.axis.moving(self.now) and self.axis.kind in ("MA", "MR"):
            raise Fault(MOVING_SAVE)
        nonvolatile.save(self)

    def initialise(self) -> None:
        """IP. Raises Fault (74)."""
        if self.axis.moving(self.now):
            raise Fault(MOVING_CLEAR)
        nonvolatile.load(self)

    def factory(self) -> None:
        """FD: programs, variables and settings are gone. Raises Fault (73)."""
        if self.axis.moving(self.now):
            raise Fault(MOVING_SAVE)
        nonvolatile.erase(self)
        self.restart()
