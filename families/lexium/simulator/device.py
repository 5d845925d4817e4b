"""A simulated MCode drive, put together: what its ports, the world and a program run ask of it.

`execute` carries out one line at once, between two lines of the program; `event_loop` lets time pass. The port in front
of a device does echo, prompts and checksums. A cell file puts into a drive its identity, variables, program, settings
and counters: lines that are carried out as if they were sent.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.dialects.family import Motion
from multidrop.dialects.program_files import check_comment
from multidrop.families.lexium.manual.errors import text as error_text
from multidrop.families.lexium.manual.grammar import LineError, parse, strip
from multidrop.families.lexium.manual.program_file import bare, commented, remark_at
from multidrop.families.lexium.simulator.event_loop import EventLoop
from multidrop.families.lexium.simulator.language.instructions import Instructions
from multidrop.families.lexium.simulator.motion.feedback import FIXED, VARIABLE
from multidrop.families.lexium.simulator.motion.motor import LexiumMotor
from multidrop.families.lexium.simulator.motion.outputs import Outputs
from multidrop.families.lexium.simulator.power import Nvm, Power
from multidrop.families.lexium.simulator.state.errors import CRLF, DriveFault
from multidrop.families.lexium.simulator.state.interpreter import Core
from multidrop.families.lexium.simulator.state.memory import Memory
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.kinematics import Effort
from multidrop.simulator.world import World

WORDS = {"position": "P"}
"""Words by the key of a counter in `identity`; the other keys are words."""
PASSES = 3
"""Times that `set` is carried out: until nothing is refused any more, and what that has scaled is set again."""
SHORTEST_US = 1.0
"""No line takes less, so that a loop always ends at some time."""
parsed = lru_cache(maxsize=1024)(parse)
"""Clients that watch a drive send the same few lines again and again."""


class PrintedAnswer(NamedTuple):
    """What a line printed: whole lines, what a PR that ends in a semicolon left, and whether it was refused."""

    lines: tuple[str, ...] = ()
    tail: str = ""
    refused: bool = False


class MCodeDevice(EventLoop):
    """One drive. Times are seconds and never go back. Raises Diagnostic for a spec that it cannot be set up with."""

    def __init__(self, spec: DriveSpec, world: World) -> None:
        self.spec, self.world = spec, world
        self.memory = memory = Memory(spec.personality)
        own, model = spec.identity, memory.model
        memory.model = model._replace(part=own.part or model.part, version=own.version or model.version)
        period = max(spec.instruction_us, SHORTEST_US) / 1e6
        core = Core(memory, world, period, lambda line: self.language.compile_stored(line))
        self.program, self.errors, self._mode = core.program, core.errors, core.mode
        motor = LexiumMotor(core)
        outputs = Outputs(core, motor)
        motor.inputs.put_out = outputs.put_out
        self.nvm = Nvm(core, motor, outputs)
        super().__init__(core, motor, outputs, Power(core, motor, outputs, self.nvm))
        self.language = Instructions(own.serial or f"0401{ord(spec.name[:1] or '!'):05d}", self)
        _set_up(self, spec)
        self.power_unit.boot()
        # Let the counters begin where a snapshot found them: P first, then what P does not say. Raises Diagnostic.
        counters = {WORDS.get(key, key): value for key, (value,) in own.counters.items()}
        for word in sorted(counters, key=lambda word: word != "P"):
            _accept(self, f"{word}={counters[word]}", f"drive {spec.name}: identity")

    # What is read.

    @property
    def now(self) -> float:
        return self._timeline.now

    @property
    def powered(self) -> bool:
        return self.bridges.powered

    @property
    def running(self) -> bool:
        """BY."""
        return self.thread.running

    @property
    def programming(self) -> int | None:
        """Where program mode stores the next line; None: it is not on."""
        return self._mode.address

    def position(self, now: float) -> int:
        """P at a time not before the last one."""
        counters = self.motor.counters
        return counters.shown(counters.source, now)

    def align(self, _: str, position: int, now: float) -> None:
        self.advance(now)
        self.motor.stop(now)
        self.execute(f"P={position}", now, immediate=True)

    def motion(self, now: float) -> Motion:
        """P and V, likewise."""
        return Motion(self.position(now), self.velocity(now))

    @property
    def effort(self) -> Effort:
        """What the axis commands now, and what P and LL tell of it."""
        values, memory = self.memory.values, self.memory
        closed, counting = values.get("AS") in (FIXED, VARIABLE), memory.counting
        current, lag = float(values["RC"]) / 100, "LL" if closed else ""
        return Effort(self.motor.axis.profile, memory.steps_per_turn, memory.scale, current, counting, lag)

    def velocity(self, now: float) -> int:
        """V, likewise."""
        return self.motor.status.speed(now)

    def moving(self, now: float) -> bool:
        """MV, likewise."""
        return self.motor.status.reported(now)

    def outputs(self, now: float) -> dict[int, bool]:
        """Which outputs are active, by number, likewise."""
        return {n: self.output_lines.active(n, now) for n in self.output_lines.types}

    # Lines.

    def execute(self, text: str, now: float, *, immediate: bool = False) -> PrintedAnswer:
        """Carry out one line; in program mode store it, unless it is `immediate`. Never raises, whatever the text."""
        if self.calm and self.quiet(now, self.thread.running):  # nothing has happened since the last line
            self._timeline.now = max(self._timeline.now, now)
        else:
            self.advance(now)
        if not self.bridges.powered:
            return PrintedAnswer(refused=True)
        printer = self._printer
        printer.begin_answer()
        self.calm = refused = False
        immediate = immediate or self._mode.address is None
        try:
            statement = parsed(text, self._mode.known_names())
            if statement is None:
                pass
            elif immediate:
                self.language.compile(statement, stored=False)()
                self.calm = statement.word == "PR"  # which changes nothing that there is to look at
            elif statement.word == "PG" and not statement.arguments:
                self._mode.address = None
            else:
                self.language.compile(statement, stored=True)
                self._mode.store(statement, strip(text))
        except (LineError, DriveFault) as error:
            refused = True
            self.interpreter.refuse(error.code, handle=immediate)
        *lines, tail = printer.end_answer().split(CRLF)
        return PrintedAnswer(tuple(lines), tail, refused)

    def fail(self, code: int, now: float) -> None:
        """Set an error that the port has found, such as a line that is too long."""
        self.advance(now)
        self.interpreter.refuse(code, handle=self._mode.address is None)

    def prints(self) -> list[tuple[float, str]]:
        return self._printer.take()

    # Keys and power.

    def escape(self, now: float) -> None:
        """ESC or ^E: motor and program stop at once, without a ramp (manual 3.4.4)."""
        self.advance(now)
        self.motor.torque.halt()
        self.motor.stop(self.now)
        self.thread.finish()
        self._timeline.replan()

    def enter(self, now: float) -> None:
        """Take a carriage return without a command: it ends what IV waits for (manual 5.1.61)."""
        self.advance(now)
        if self.memory.awaited:
            self.memory.await_input("")
            self.calm = False

    def step(self, key: str, now: float) -> None:
        """A key of single step: space or carriage return."""
        self.advance(now)
        self.interpreter.step(key, self.now)

    def reset(self, now: float) -> None:
        """^C: begin again with what NVM holds (manual 3.4.4)."""
        self.advance(now)
        if self.powered:
            self.power_unit.restart()

    def power(self, on: bool, now: float) -> None:
        """Switch the drive on or off. What NVM holds stays."""
        self.advance(now)
        self.power_unit.switch(on)

    def supply(self, on: bool, now: float) -> None:
        """Switch +V alone, with the auxiliary supply left on (manual 5.1.127)."""
        self.advance(now)
        self.power_unit.supply(on)


def _set_up(device: MCodeDevice, spec: DriveSpec) -> None:
    """Put what the spec says into NVM. What the inputs are meanwhile is nothing to react to. Raises Diagnostic.

    One line of `set` may need another first, and MS and EE change speeds. A line that was accepted once may be refused
    later and be in force all the same: MF, when VM is below it. AS comes last, as the motor may turn from there on; EE
    just before it, so that speeds in steps stay in steps.
    """
    inputs, where = device.motor.inputs, f"drive {spec.name}"
    inputs.begin(0.0)
    inputs.watched = False
    for name, value in spec.variables.items():
        _accept(device, f"VA {name}={value}", f"{where}: variables")
    for number, line in enumerate(split_lines(spec.program), 1):
        place = f"{spec.program_name or 'program'}:{number}"
        for problem in check_comment(line, number, remark_at(line)):
            if not problem.warning:
                raise Diagnostic(problem.what, place, problem.hint)
        _accept(device, bare(line), place)
    device.core.mode.address = None
    device.core.thread.finish()
    device.motor.stop(0.0)
    device.memory.texts["DN"] = spec.name
    lines = [*spec.assignments(), *([("PY", "1")] if spec.party else [])]
    last = ("EE", "AS") if spec.set.get("AS") else ("AS",)
    late = [assignment for name in last for assignment in lines if assignment[0] == name]
    early = [assignment for assignment in lines if assignment not in late]
    for each in lines:
        _check_whole("=".join(each), f"{where}: set")
    refused = early
    for _ in range(PASSES):
        again = [assignment for assignment in early if device.execute("=".join(assignment), 0.0).refused]
        refused = [assignment for assignment in refused if assignment in again]
    for pair in (*late, *refused):
        _accept(device, "=".join(pair), f"{where}: set")
    device.nvm.keep()
    inputs.watched = True


def _check_whole(line: str, where: str) -> None:
    """Raise Diagnostic for a line of which the drive would ignore a part."""
    if commented(line):
        raise Diagnostic(f"{line}: a comment would be cut off", where, "delete it")


def _accept(device: MCodeDevice, line: str, where: str) -> None:
    """Have a drive carry out a line at the start. Raises Diagnostic with the reason for its refusal."""
    _check_whole(line, where)
    if device.execute(line, 0.0).refused:
        code, product = device.errors.code, device.spec.personality
        why = f"refused by an {product}: error {code}, {error_text(code, product)}"
        raise Diagnostic(f"{line.strip()}: {why}", where)
