"""Program execution in virtual time, program mode, and the core of a drive that every other part is built on.

Theory of operation. When a program starts, its lines are compiled to closures (`LinkedProgram`). Each line takes effect
at the time at which it begins and then takes the drive's instruction time; the next line begins after that. `run`
executes everything that is due before a time at which something else happens. A part that changes what else may happen
(a motion, a trip, an input) calls `timeline.replan`, and `run` comes back so that the next event can be worked out
again. So the order of all events is that of their exact times, however time is advanced. Manual 3.3, 5.1.13, 5.1.22,
5.1.42, 5.1.91, 5.1.98.

The thread of a running program knows which line comes next and when, the stack of subroutines, holds and pauses. H does
not poll: a program that holds for a motion is not alive until the motion is over. A trip or the error handler is a
subroutine that is called between two lines; a hold that it interrupts goes on after its RT. Manual 5.1.22, 5.1.35,
5.1.50, 5.1.103, 5.1.111, 5.1.112.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import Argument, NameTerm, Statement, is_name
from multidrop.families.lexium.manual.table import lookup
from multidrop.families.lexium.simulator.state.errors import CRLF, DriveFault, DriveOutput, ErrorFlag, Timeline
from multidrop.families.lexium.simulator.state.memory import TABLE_SIZE, Memory
from multidrop.families.lexium.simulator.state.program_memory import Action, LinkedProgram, ProgramContents
from multidrop.simulator.world import World

STACK_DEPTH = 10
"""How deep subroutines may be nested (of the maker's older drives; the manual does not say)."""
NORMAL, TRACED, STEPPED, SILENT = 0, 1, 2, 3
"""How a program runs: EX's modes, and SILENT: a stepped one that has not come to its break point yet."""
Resume = Callable[[float], None]


@dataclass
class CallFrame:
    """Where a subroutine returns to, and the hold that it interrupted: for motion, or until a time. `ending`: it is
    the end of the program that waits for motion.
    """

    back: int
    waiting: bool = False
    hold_until: float = -inf
    ending: bool = False


class ProgramThread:
    """The one program that a drive can run. `next_at` is when line `pc` is due, `executed` counts lines.

    `live`: lines are executed. It is asleep while `paused`, `waiting` (H for motion), `ending` (E after the motion), or
    stepped without a key. `handling` is the depth of the stack in the subroutine of OE, 0 outside.
    """

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline
        self.running = self.paused = self.waiting = self.ending = False
        self.live = False
        self.executed = 0
        self.mode = NORMAL
        self.steps = 0
        self.next_at = inf
        self.pc = 0
        self.stack: list[CallFrame] = []
        self.handling = 0
        self.stopped_motion: Resume | None = None
        self._hold_until = -inf

    def begin(self, entry: int, t: float, mode: int) -> None:
        self.running, self.paused, self.waiting, self.ending = True, False, False, False
        self.stack.clear()
        self.handling, self._hold_until, self.steps = 0, -inf, 0
        self.stopped_motion = None
        self.pc, self.next_at, self.mode = entry, t, mode
        self.refresh()

    def finish(self) -> None:
        self.running = self.paused = self.waiting = self.ending = False
        self.stack.clear()
        self.handling = 0
        self.next_at = inf
        self.refresh()

    def refresh(self) -> None:
        stepped = self.mode == STEPPED and self.steps <= 0
        self.live = self.running and not (self.paused or self.waiting or self.ending or stepped)
        self._timeline.replan()

    # Time.

    def wake(self, t: float) -> None:
        self.waiting = False
        self.next_at = max(self.next_at, t)
        if self.ending:
            self.finish()
        self.refresh()

    def delay(self, until: float) -> None:
        if self.live:
            self.next_at = max(self.next_at, until)

    # Pausing and stepping.

    def pause(self, stopped_motion: Resume | None) -> None:
        """Pause; `stopped_motion` takes up the motion that the pause has stopped, if it has stopped one."""
        self.paused = True
        self.stopped_motion = stopped_motion or self.stopped_motion
        self.refresh()

    def go_on(self, t: float) -> Resume | None:
        """Go on after a pause; return what takes up the motion that the pause has stopped."""
        self.paused = False
        self.next_at = max(self.next_at, t)
        again, self.stopped_motion = self.stopped_motion, None
        self.refresh()
        return again

    def drop_motion(self) -> None:
        """Forget the motion that a pause has stopped: RS does not take it up."""
        self.stopped_motion = None

    @property
    def stepping(self) -> bool:
        """Return whether it waits for the keys of single step."""
        return self.running and self.mode == STEPPED

    def step_from_here(self) -> None:
        """Wait for a key before each line from now on."""
        self.mode, self.steps = STEPPED, 0
        self.refresh()

    # What lines do.

    def hold_for_motion(self, ending: bool = False) -> None:
        """H: wait until the motion is over; `ending`: that is the end of the program too."""
        if ending:
            self.ending = True
        else:
            self.waiting = True
        self.refresh()

    def hold(self, seconds: float) -> None:
        """H with a time."""
        self._hold_until = self.next_at = max(self.next_at, self._timeline.now + seconds)

    def call(self, entry: int) -> None:
        """Go on elsewhere until RT. Raises DriveFault (43)."""
        self.push(CallFrame(self.pc))
        self.pc = entry

    def give_back(self) -> None:
        """RT. Raises DriveFault (43) where nothing was called."""
        if not self.stack:
            raise DriveFault(E.STACK_FULL, fatal=True)
        frame = self.stack.pop()
        if len(self.stack) < self.handling:
            self.handling = 0
        self.pc = frame.back
        if frame.waiting or frame.ending:
            self.waiting, self.ending = frame.waiting, frame.ending
            self.refresh()
        elif frame.hold_until > self.next_at:
            self._hold_until = self.next_at = frame.hold_until

    def interrupt(self, entry: int, t: float) -> None:
        """Call a subroutine before the next line, in the middle of a hold too. Raises DriveFault (43)."""
        holding = self._hold_until > t
        self.push(CallFrame(self.pc, self.waiting, self._hold_until if holding else -inf, self.ending))
        if self.waiting or holding or self.ending:
            self.next_at, self._hold_until = t, -inf
        self.waiting = self.ending = False
        self.pc = entry
        self.refresh()

    def push(self, frame: CallFrame) -> None:
        if len(self.stack) >= STACK_DEPTH:
            raise DriveFault(E.STACK_FULL, fatal=True)
        self.stack.append(frame)


class ProgramMode:
    """Program mode of one drive: between PG with an address and PG lines are stored (manual 3.3, 5.1.98).

    `address` is where the next line is stored; None: it is not on. The names that a user gives, labels and variables,
    share one table (manual 3.2.2, 3.3.1, 5.1.71, 5.1.136).
    """

    def __init__(self, memory: Memory, program: ProgramContents, linked: LinkedProgram) -> None:
        self._memory, self._program, self._linked = memory, program, linked
        self.address: int | None = None

    def store(self, statement: Statement, text: str) -> None:
        """Store one more line, which compiles. Raises DriveFault (24, 28, 29, 31, 45)."""
        address = self.address or 0
        name = self._new_label(statement) if statement.word == "LB" else ""
        self.address = self._program.store(address, text, statement)
        if name:
            self._program.labels[name] = address
        self._linked.forget()

    def known_names(self) -> frozenset[str]:
        return frozenset((*self._memory.scopes, *self._program.labels, *self._program.declared))

    def check_new(self, word: str) -> None:
        """Check that a name may be given. Raises DriveFault (24 bad or reserved, 28 taken, 29 a mnemonic)."""
        row = lookup(word, self._memory.product)
        if row is not None:
            raise DriveFault(E.ILLEGAL_DATA if row.kind == "reserved" else E.NAME_IS_COMMAND)
        if not is_name(word) or len(word) > self._memory.model.longest_name:
            raise DriveFault(E.ILLEGAL_DATA)
        if word in self._program.labels or self._memory.scopes.get(word) == "G":
            raise DriveFault(E.NAME_EXISTS)

    def check_room(self) -> None:
        """Check that one more name fits. Raises DriveFault (31)."""
        if len(self._program.labels) + len(self._memory.scopes) >= TABLE_SIZE:
            raise DriveFault(E.NAME_TABLE_FULL)

    def _new_label(self, statement: Statement) -> str:
        """The name that an LB line gives. Raises DriveFault (24, 28, 29, 31)."""
        name = statement.arguments[0]
        if not isinstance(name, NameTerm):
            raise DriveFault(E.ILLEGAL_DATA)
        if name.word == "SU":
            if "SU" in self._program.labels:
                raise DriveFault(E.NAME_EXISTS)
        else:
            self.check_new(name.word)
            if name.word in self._memory.scopes or name.word in self._program.declared:
                raise DriveFault(E.NAME_EXISTS)
        self.check_room()
        return name.word


class Interpreter:
    """Runs the program of one drive. `period` is the time of a line, `handler` the target of OE."""

    def __init__(self, core: Core, period: float, compile_line: Callable[[Statement], Action]) -> None:
        self._memory, self._program, self._timeline = core.memory, core.program, core.timeline
        self._errors, self._printer, self._thread = core.errors, core.printer, core.thread
        self.period = period
        self.linked = LinkedProgram(core.program, compile_line, core.thread.finish)
        self.handler: Argument | None = None
        self._break: tuple[int, int] | None = None
        self._passes = 0
        self._executing = False
        self._before: Callable[[int], bool] | None = None
        self._after: Callable[[int], None] | None = None

    def watch(self, before: Callable[[int], bool] | None, after: Callable[[int], None] | None) -> None:
        """Call `before` and `after` each line; the program ends where `before` returns True."""
        self._before, self._after = before, after

    # Starting and ending.

    def start(self, target: Argument | None, t: float, mode: int = NORMAL) -> None:
        """EX; a program that runs is left for it, as clients of real units rely on.

        Raises DriveFault (24, 30, 34, 42).
        """
        self._program.resolve(target)
        self._memory.forget_local()
        self._errors.clear()
        self._memory.await_input("")
        self._begin(self.linked.entry(target), t, mode)

    def _begin(self, entry: int, t: float, mode: int) -> None:
        self._passes = 0
        if mode == STEPPED and self._break is not None:
            mode = SILENT
        self._thread.begin(entry, t, mode)

    def clear(self) -> None:
        """Become as at power-up: nothing runs, no handler, no break point."""
        self._thread.finish()
        self.linked.forget()
        self.handler, self._break = None, None

    # Stepping.

    def step(self, key: str, t: float) -> None:
        """Space runs one line, Enter the rest, or up to the break point (manual 5.1.42)."""
        thread = self._thread
        if not thread.stepping:
            return
        if key == " ":
            thread.steps += 1
        else:
            thread.mode = NORMAL if self._break is None else SILENT
            self._passes = -int(self._at_break(thread.pc))
        thread.next_at = max(thread.next_at, t)
        thread.refresh()

    def break_at(self, target: Argument | None, passes: int) -> None:
        """BP: step from a place on, when it was reached so many times; None: nowhere. Raises DriveFault (30, 42)."""
        self._passes = 0
        self._break = None if target is None else (self._program.resolve(target), passes)

    def break_here(self) -> None:
        """BP alone: step from here on. Raises DriveFault (40)."""
        if not self._thread.running:
            raise DriveFault(E.NO_PROGRAM_RUNNING)
        self._thread.step_from_here()

    def _at_break(self, pc: int) -> bool:
        return self._break is not None and self.linked.index.get(self._break[0]) == pc

    def _breaks(self, pc: int) -> bool:
        """Return whether stepping begins before this line."""
        if self._thread.mode in (NORMAL, STEPPED) or not self._at_break(pc):
            return False
        self._passes += 1
        if self._break is None or self._passes < self._break[1]:
            return False
        self._thread.step_from_here()
        return True

    # Execution.

    def run(self, until: float) -> None:
        """Execute the lines that are due at or before `until`, or up to the one that changes what else is due."""
        self._executing = True
        if self._thread.mode == NORMAL and self._after is None:
            self._run(until)
        else:
            self._run_shown(until)
        self._executing = False

    def _run(self, until: float) -> None:
        thread, timeline, actions, period = self._thread, self._timeline, self.linked.actions, self.period
        count = 0
        while thread.live and (at := thread.next_at) <= until and not timeline.outdated:
            count += 1
            pc = thread.pc
            timeline.now = at
            thread.pc = pc + 1
            thread.next_at = at + period
            try:
                actions[pc]()
            except DriveFault as fault:
                self._on_fault(fault)
        thread.executed += count

    def _run_shown(self, until: float) -> None:
        """Execute line by line, each printed before it is executed (EX modes 1 and 2), and with break points."""
        thread, timeline, linked = self._thread, self._timeline, self.linked
        while thread.live and thread.next_at <= until and not timeline.outdated:
            timeline.now, pc = thread.next_at, thread.pc
            if self._breaks(pc):
                return
            if self._before is not None and self._before(pc):
                return thread.finish()
            if linked.texts[pc] and thread.mode in (TRACED, STEPPED) and not self._memory.values["LK"]:
                self._printer.emit(linked.texts[pc] + CRLF)
            thread.pc = pc + 1
            thread.next_at = timeline.now + self.period
            thread.steps -= thread.mode == STEPPED
            thread.executed += 1
            try:
                linked.actions[pc]()
            except DriveFault as fault:
                self._on_fault(fault)
            if self._after is not None:
                self._after(pc)
            if thread.mode != NORMAL:
                thread.refresh()

    def line(self) -> int:
        """The line of the program that is at work or holds; between two lines, the next one."""
        thread = self._thread
        holding = thread.waiting or thread.next_at > self._timeline.now + self.period
        return thread.pc - (self._executing or holding)

    # Trips and errors.

    def interrupt(self, target: Argument | None, t: float) -> None:
        """Call the subroutine of a trip before the next line. Faults go to the drive's error register."""
        if target is None:
            return
        try:
            self._call_between_lines(target, t)
        except DriveFault as fault:
            self._on_fault(fault)

    def _call_between_lines(self, target: Argument, t: float) -> None:
        if self._thread.running:
            self._thread.interrupt(self.linked.place(target), t)
        else:  # its RT ends it
            self._begin(self.linked.entry(target), t, NORMAL)
            self._thread.push(CallFrame(len(self.linked.actions) - 1))

    def raise_error(self, code: int) -> None:
        """Set an error that no line has caused, and call its handler."""
        self._errors.set(code)
        self.on_error(self._timeline.now)
        self._timeline.replan()

    def refuse(self, code: int, handle: bool) -> None:
        """Set the error of a typed line; `handle`: call its handler."""
        self._errors.set(code)
        if handle:
            self.on_error(self._timeline.now)

    def on_error(self, t: float) -> bool:
        """Call the error handler, if one is declared and not at work already. Return whether it was called."""
        if self.handler is None or self._thread.handling:
            return False
        try:
            self._call_between_lines(self.handler, t)
        except DriveFault:
            return False
        self._thread.handling = len(self._thread.stack)
        self._errors.handled()
        return True

    def _on_fault(self, fault: DriveFault) -> None:
        """Act on an error in a line: without a handler the next one follows, unless there is none to follow."""
        self._errors.set(fault.code)
        if not self.on_error(self._timeline.now) and fault.fatal:
            self._thread.finish()


class Core:
    """The parts of a drive that all others are built on; `compile_line` compiles a stored line."""

    def __init__(
        self, memory: Memory, world: World, period: float, compile_line: Callable[[Statement], Action]
    ) -> None:
        self.memory, self.values, self.model, self.world = memory, memory.values, memory.model, world
        self.timeline = Timeline()
        self.program = ProgramContents(product=memory.product)
        self.errors = ErrorFlag(memory.values, memory.model.codes, self.timeline)
        self.thread = ProgramThread(self.timeline)
        self.printer = DriveOutput(self.timeline, memory.model.waits_to_print, self.thread.delay)
        self.interpreter = Interpreter(self, period, compile_line)
        self.errors.line = self.interpreter.line
        self.mode = ProgramMode(memory, self.program, self.interpreter.linked)
