"""Program execution in virtual time.

Theory of operation. When a program starts, its lines are compiled to closures (`linked_program`). Each line takes
effect at the time at which it begins and then takes the drive's instruction time; the next line begins after that.
`run` executes everything that is due before a time at which something else happens. Whoever changes what else may
happen (a motion, a trip, an input) calls `timeline.replan`, and `run` comes back so that the next event can be worked
out again. So the order of all events is that of their exact times, however time is advanced.
Manual 5.1.13, 5.1.22, 5.1.42, 5.1.91.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Argument, Statement
from multidrop.simulator.lexium.language.program_mode import Action, LinkedProgram
from multidrop.simulator.lexium.language.thread import NORMAL, SILENT, STEPPED, TRACED, Frame, Thread
from multidrop.simulator.lexium.state.error_flag import ErrorFlag
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.memory import Memory
from multidrop.simulator.lexium.state.printer import CRLF, Printer
from multidrop.simulator.lexium.state.program_memory import Program
from multidrop.simulator.lexium.state.timeline import Timeline


class Observer(Protocol):
    """Somebody who looks at each line of a program in virtual time; a unit has no such thing."""

    def before(self, line: int) -> bool:
        """Return whether the program ends before this line."""

    def after(self, line: int) -> None:
        """Take note that a line was executed."""


class Interpreter:
    """Runs the program of one drive; motion controls it as a `ProgramControl`.

    `period` is the time of a line, `handler` the target of OE, `executed` counts lines.
    """

    observer: Observer | None = None

    def __init__(
        self,
        memory: Memory,
        program: Program,
        timeline: Timeline,
        errors: ErrorFlag,
        printer: Printer,
        thread: Thread,
        period: float,
        compile_line: Callable[[Statement], Action],
    ) -> None:
        self._memory, self._program, self._timeline = memory, program, timeline
        self._errors, self._printer = errors, printer
        self.thread, self.period = thread, period
        self.linked = LinkedProgram(program, compile_line, thread.finish)
        self.handler: Argument | None = None
        self.executed = 0
        self._break: tuple[int, int] | None = None
        self._passes = 0
        self._executing = False

    # Starting and ending.

    @property
    def running(self) -> bool:
        """BY."""
        return self.thread.running

    def start(self, target: Argument | None, t: float, mode: int = NORMAL) -> None:
        """EX; a program that runs is left for it, as clients of real units rely on. Raises Fault (24, 30, 34, 42)."""
        self._program.resolve(target)
        self._memory.forget_local()
        self._errors.clear()
        self._memory.await_input("")
        self._begin(self.linked.entry(target), t, mode)

    def _start_subroutine(self, target: Argument | None, t: float) -> None:
        """Run a subroutine while no program runs (OE, trips); its RT ends it. Raises Fault."""
        self._begin(self.linked.entry(target), t, NORMAL)
        self.thread.stack.append(Frame(len(self.linked.actions) - 1))

    def _begin(self, entry: int, t: float, mode: int) -> None:
        self._passes = 0
        if mode == STEPPED and self._break is not None:
            mode = SILENT
        self.thread.begin(entry, t, mode)

    def finish(self) -> None:
        """End the program."""
        self.thread.finish()

    def clear(self) -> None:
        """Become as at power-up: nothing runs, no handler, no break point."""
        self.thread.finish()
        self.linked.forget()
        self.handler, self._break = None, None

    def drop_motion(self) -> None:
        """Forget the motion that a pause has stopped: RS does not take it up."""
        self.thread.stopped_motion = None

    # Stepping.

    def step(self, key: str, t: float) -> None:
        """Space runs one line, Enter the rest, or up to the break point (manual 5.1.42)."""
        thread = self.thread
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
        """BP: step from a place on, when it has been come to so many times; None: nowhere. Raises Fault (30, 42)."""
        self._passes = 0
        self._break = None if target is None else (self._program.resolve(target), passes)

    def break_here(self) -> None:
        """BP alone: step from here on. Raises Fault (40)."""
        if not self.thread.running:
            raise Fault(E.NO_PROGRAM_RUNNING)
        self.thread.step_from_here()

    def _at_break(self, pc: int) -> bool:
        return self._break is not None and self.linked.index.get(self._break[0]) == pc

    def _breaks(self, pc: int) -> bool:
        """Whether stepping begins before this line."""
        if self.thread.mode in (NORMAL, STEPPED) or not self._at_break(pc):
            return False
        self._passes += 1
        if self._break is None or self._passes < self._break[1]:
            return False
        self.thread.step_from_here()
        return True

    # Execution.

    def run(self, until: float) -> None:
        """Execute the lines that are due at or before `until`, or up to the one that changes what else is due."""
        self._executing = True
        if self.thread.mode == NORMAL and self.observer is None:
            self._run(until)
        else:
            self._run_shown(until)
        self._executing = False

    def _run(self, until: float) -> None:
        thread, timeline, actions, period = self.thread, self._timeline, self.linked.actions, self.period
        count = 0
        while thread.live and thread.next_at <= until and not timeline.outdated:
            count += 1
            at, pc = thread.next_at, thread.pc
            timeline.now = at
            thread.pc = pc + 1
            thread.next_at = at + period
            try:
                actions[pc]()
            except Fault as fault:
                self._on_fault(fault)
        self.executed += count

    def _run_shown(self, until: float) -> None:
        """Execute line by line, each printed before it is executed (EX modes 1 and 2), and with break points."""
        thread, timeline, linked, observer = self.thread, self._timeline, self.linked, self.observer
        while thread.live and thread.next_at <= until and not timeline.outdated:
            timeline.now, pc = thread.next_at, thread.pc
            if self._breaks(pc):
                return
            if observer is not None and observer.before(pc):
                return thread.finish()
            if linked.texts[pc] and thread.mode in (TRACED, STEPPED) and not self._memory.values["LK"]:
                self._printer.emit(linked.texts[pc] + CRLF)
            thread.pc = pc + 1
            thread.next_at = timeline.now + self.period
            thread.steps -= thread.mode == STEPPED
            self.executed += 1
            try:
                linked.actions[pc]()
            except Fault as fault:
                self._on_fault(fault)
            if observer is not None:
                observer.after(pc)
            if thread.mode != NORMAL:
                thread.refresh()

    def line(self) -> int:
        """The line of the program that is at work or holds; between two lines, the next one."""
        thread = self.thread
        holding = thread.waiting or thread.next_at > self._timeline.now + self.period
        return thread.pc - (self._executing or holding)

    def branch(self, target: Argument | None) -> None:
        """Go on elsewhere. Raises Fault (30, 42)."""
        self.thread.pc = self.linked.place(target)

    def call(self, target: Argument | None) -> None:
        """Go on elsewhere until RT. Raises Fault (30, 42, 43)."""
        self.thread.call(self.linked.place(target))

    # Trips and errors.

    def interrupt(self, target: Argument | None, t: float) -> None:
        """Call the subroutine of a trip before the next line. Faults go to the drive's error register."""
        if target is None:
            return
        try:
            self._call_between_lines(target, t)
        except Fault as fault:
            self._on_fault(fault)

    def _call_between_lines(self, target: Argument, t: float) -> None:
        if self.thread.running:
            self.thread.interrupt(self.linked.place(target), t)
        else:
            self._start_subroutine(target, t)

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
        """Call the error handler, if one is declared and not at work already. Gives whether it was called."""
        if self.handler is None or self.thread.handling:
            return False
        try:
            self._call_between_lines(self.handler, t)
        except Fault:
            return False
        self.thread.handling = len(self.thread.stack)
        self._errors.handled()
        return True

    def _on_fault(self, fault: Fault) -> None:
        """Act on an error in a line: without a handler the next one follows, unless there is none to follow."""
        self._errors.set(fault.code)
        if not self.on_error(self._timeline.now) and fault.fatal:
            self.thread.finish()
