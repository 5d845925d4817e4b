"""A simulated MCode drive, put together: what its ports, the world and a program run ask of it.

`execute` carries out one line at once, between two lines of the program; how time passes is the matter of
`event_loop`. The port in front of a device deals with echo, prompts and checksums.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import NamedTuple

from multidrop.dialects.mcode.manual.errors import text as error_text
from multidrop.dialects.mcode.manual.grammar import LineError, parse, strip
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.lexium import set_up
from multidrop.simulator.lexium.event_loop import EventLoop
from multidrop.simulator.lexium.language import io_variables, motion_variables
from multidrop.simulator.lexium.language.flow import Flow
from multidrop.simulator.lexium.language.input_functions import InputFunctions
from multidrop.simulator.lexium.language.instructions import Instructions
from multidrop.simulator.lexium.language.interpreter import Interpreter
from multidrop.simulator.lexium.language.motor_commands import MotorCommands
from multidrop.simulator.lexium.language.pausing import Pausing
from multidrop.simulator.lexium.language.printed_setups import PrintedSetups
from multidrop.simulator.lexium.language.prints import Prints
from multidrop.simulator.lexium.language.program_commands import ProgramCommands
from multidrop.simulator.lexium.language.program_mode import Names, ProgramMode
from multidrop.simulator.lexium.language.setups import Setups
from multidrop.simulator.lexium.language.thread import Thread
from multidrop.simulator.lexium.language.variable_access import VariableAccess
from multidrop.simulator.lexium.motion.inputs import Inputs
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.motion.outputs import Outputs
from multidrop.simulator.lexium.motion.rotor import Rotor
from multidrop.simulator.lexium.nvm import Nvm
from multidrop.simulator.lexium.power import Power
from multidrop.simulator.lexium.state.comm_settings import CommSettings
from multidrop.simulator.lexium.state.error_flag import ErrorFlag
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.printer import CRLF, Printer
from multidrop.simulator.lexium.state.program_memory import Program
from multidrop.simulator.lexium.state.timeline import Timeline
from multidrop.simulator.world import World

SHORTEST_US = 1.0
"""No line takes less, so that a loop always ends at some time."""
parsed = lru_cache(maxsize=1024)(parse)
"""Clients that watch a drive send the same few lines again and again."""


class Answer(NamedTuple):
    """What a line printed: whole lines, what a PR that ends in a semicolon left, and whether it was refused."""

    lines: tuple[str, ...] = ()
    tail: str = ""
    refused: bool = False


class MCodeDevice(CommSettings):
    """One drive. Times are seconds and never go back. Raises Diagnostic for a spec that it cannot be set up with."""

    def __init__(self, spec: DriveSpec, world: World) -> None:
        memory = set_up.memory_of(spec)
        super().__init__(memory)
        self.spec, self.world, self.model = spec, world, memory.model
        self._timeline = timeline = Timeline()
        self.program = program = Program(product=spec.personality)
        self.errors = errors = ErrorFlag(memory.values, memory.model.codes, timeline)
        thread = Thread(timeline)
        self.printer = printer = Printer(timeline, memory.model.waits_to_print, thread.delay)
        period = max(spec.instruction_us, SHORTEST_US) / 1e6
        self.interpreter = Interpreter(
            memory, program, timeline, errors, printer, thread, period, lambda line: self.language.compile_stored(line)
        )
        errors.line = self.interpreter.line
        rotor = Rotor(memory.values, world)
        self.inputs = inputs = Inputs(memory, world, rotor)
        self.motor = motor = Motor(
            memory, timeline, world, rotor, inputs, self.interpreter, lambda: printer.emit(self.name + CRLF)
        )
        self.output_lines = outputs = Outputs(memory, timeline, motor)
        inputs.put_out = outputs.put_out
        self.nvm = nvm = Nvm(memory, program, timeline, inputs, outputs, motor, lambda: self._power.restart())
        self._names = Names(memory, program)
        self.mode = ProgramMode(program, self._names, self.interpreter.linked, nvm)
        self._power = Power(
            memory,
            program,
            timeline,
            world,
            self,
            errors,
            printer,
            self.interpreter,
            self.mode,
            inputs,
            outputs,
            motor,
            nvm,
        )
        pausing = Pausing(timeline, thread, motor)
        functions = InputFunctions(timeline, errors, inputs, motor, self.interpreter, pausing, self._power.restart)
        self._loop = EventLoop(timeline, printer, self._power, inputs, motor, self.interpreter, functions)
        self.language, self.motions = _language(self, timeline, pausing, functions)
        _set_up(self, spec)
        self._power.boot()
        set_up.begin_counters(spec, partial(_reason, self))

    # What is read.

    @property
    def now(self) -> float:
        """The drive's time."""
        return self._timeline.now

    @property
    def powered(self) -> bool:
        """Whether it has power, and is up."""
        return self._power.on

    @property
    def boots(self) -> int:
        """How often it has begun as at power-up."""
        return self._power.boots

    @property
    def running(self) -> bool:
        """BY."""
        return self.interpreter.running

    @property
    def stepping(self) -> bool:
        """Whether a program is executed step by step, and waits for keys."""
        return self.interpreter.thread.stepping

    @property
    def programming(self) -> int | None:
        """Where program mode stores the next line; None: it is not on."""
        return self.mode.address

    def position(self, now: float) -> int:
        """P at a time not before the last one."""
        return self.motor.counters.position(now)

    def velocity(self, now: float) -> int:
        """V, likewise."""
        return self.motor.status.speed(now)

    def moving(self, now: float) -> bool:
        """MV, likewise."""
        return self.motor.status.reported(now)

    def outputs(self, now: float) -> dict[int, bool]:
        """Which outputs are active, by number, likewise."""
        return {n: self.output_lines.active(n, now) for n in self.output_lines.types}

    # Time.

    @property
    def deadline(self) -> float | None:
        """When something next happens by itself; None if nothing will."""
        return self._loop.deadline

    def proceed(self, now: float) -> float | None:
        """Let time pass up to `now`, or to where there is news; gives when that is, None for nothing."""
        return self._loop.proceed(now)

    def advance(self, now: float, *, program: bool = False) -> None:
        """Let everything happen that is due up to `now`; `program`: but stop when no program runs any more."""
        self._loop.advance(now, program=program)

    def quiet(self, now: float, running: bool) -> bool:
        """Whether nothing changes up to `now`, if it was `running` before. Quick to ask."""
        return self._loop.quiet(now, running)

    # Lines.

    def execute(self, text: str, now: float, *, immediate: bool = False) -> Answer:
        """Carry out one line; in program mode store it, unless it is `immediate`. Never raises, whatever the text."""
        self._loop.advance_to_line(now)
        if not self.powered:
            return Answer(refused=True)
        self.printer.begin_answer()
        self._loop.calm = refused = False
        immediate = immediate or self.mode.address is None
        try:
            self._carry_out(text, immediate)
        except (LineError, Fault) as error:
            refused = True
            self.interpreter.refuse(error.code, handle=immediate)
        *lines, tail = self.printer.end_answer().split(CRLF)
        return Answer(tuple(lines), tail, refused)

    def _carry_out(self, text: str, immediate: bool) -> None:
        statement = parsed(text, self._names.known())
        if statement is None:
            return
        if immediate:
            self.language.compile(statement, stored=False)()
            self._loop.calm = statement.word == "PR"  # which changes nothing that there is to look at
        elif statement.word == "PG" and not statement.arguments:
            self.mode.address = None
        else:
            self.language.compile(statement, stored=True)
            self.mode.store(statement, strip(text))

    def fail(self, code: int, now: float) -> None:
        """Set an error that the port has found, such as a line that is too long."""
        self.advance(now)
        self.interpreter.refuse(code, handle=self.mode.address is None)

    def prints(self) -> list[tuple[float, str]]:
        """What was printed by itself since this was last asked, with the times."""
        return self.printer.take()

    # Keys and power.

    def escape(self, now: float) -> None:
        """ESC or ^E: motor and program stop at once, without a ramp (manual 3.4.4)."""
        self.advance(now)
        self.motor.torque.halt()
        self.motor.stop(self.now)
        self.interpreter.finish()
        self._timeline.replan()

    def step(self, key: str, now: float) -> None:
        """A key of single step: space or carriage return."""
        self.advance(now)
        self.interpreter.step(key, self.now)

    def reset(self, now: float) -> None:
        """^C: begin again with what NVM holds (manual 3.4.4)."""
        self.advance(now)
        if self.powered:
            self._power.restart()

    def power(self, on: bool, now: float) -> None:
        """Switch the drive on or off. What NVM holds stays."""
        self.advance(now)
        self._power.switch(on)

    def world_changed(self) -> None:
        """Look at the world again: `/sim` has changed it."""
        self._timeline.replan()

    def supply(self, on: bool, now: float) -> None:
        """Switch +V alone, with the auxiliary supply left on (manual 5.1.127)."""
        self.advance(now)
        self._power.supply(on)


def _language(
    device: MCodeDevice, timeline: Timeline, pausing: Pausing, functions: InputFunctions
) -> tuple[Instructions, MotorCommands]:
    """The language over all other parts."""
    memory, program, timeline, printer = device.memory, device.program, timeline, device.printer
    motor, inputs, outputs, interpreter = device.motor, device.inputs, device.output_lines, device.interpreter
    nvm, trips, serial = device.nvm, motor.trips, set_up.serial_of(device.spec)
    variables = VariableAccess(
        memory,
        program,
        timeline,
        running=lambda: interpreter.running,
        saved_lock=lambda: nvm.locked,
        readers={
            **motion_variables.readers(timeline, motor),
            **io_variables.readers(timeline, inputs, trips),
        },
        writers={
            **motion_variables.MotionWriters(memory, timeline, motor).table(),
            **io_variables.IoWriters(memory, timeline, inputs, outputs, trips, motor.jog).table(),
        },
    )
    motions = MotorCommands(memory, timeline, variables, motor)
    setups = PrintedSetups(inputs, outputs, motor.limits, trips)
    return Instructions(
        memory,
        program,
        variables,
        Flow(memory, program, timeline, printer, variables, device._names, interpreter, pausing, motor),
        ProgramCommands(memory, program, timeline, printer, variables, interpreter, device.mode, motor.status, nvm),
        motions,
        Setups(memory, program, timeline, variables, inputs, outputs, motor, functions),
        Prints(serial, memory, program, timeline, printer, device.errors, variables, motor, setups),
        nvm,
    ), motions


def _set_up(device: MCodeDevice, spec: DriveSpec) -> None:
    """Put what the spec says into NVM. What the inputs are meanwhile is nothing to react to. Raises Diagnostic."""
    execute = partial(_reason, device)
    device.inputs.begin(0.0)
    device.inputs.watched = False
    set_up.load(spec, execute)
    device.mode.address = None
    device.interpreter.finish()
    device.motor.stop(0.0)
    device.memory.texts["DN"] = spec.name
    set_up.assign(spec, execute)
    device.nvm.keep()
    device.inputs.watched = True


def _reason(device: MCodeDevice, line: str) -> str:
    """Carry out a line at the start; return the reason for its refusal, empty for none."""
    if not device.execute(line, 0.0).refused:
        return ""
    code, product = device.errors.code, device.spec.personality
    return f"refused by an {product}: error {code}, {error_text(code, product)}"
