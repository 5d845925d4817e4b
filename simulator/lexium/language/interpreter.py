"""Program execution in virtual time.

Theory of operation. When a program starts, its lines are compiled to closures in a list; labels are no lines of it
(they are marks and take no time). Each line takes effect at the time at which it begins and then takes the drive's
instruction time; the next line begins after that. `run` executes everything that is due before a time at which
something else happens; whoever changes what else may happen (a motion, a trip, an input) sets `device.stale`, and `run`
comes back so that the horizon can be worked out anew. So the order of all events is that of their exact times, and it
does not matter in how many steps time is advanced.

H does not poll: a program that holds for a motion is not alive until the motion is over. Trips and the error handler
are subroutines that are called between two lines; a hold that they interrupt goes on after their RT.
Manual 5.1.22, 5.1.35, 5.1.42, 5.1.50, 5.1.91, 5.1.103, 5.1.111, 5.1.112.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

from dialects.mcode.manual.grammar import Argument
from simulator.lexium.state.errors import Fault

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

Action = Callable[[], None]

STACK_DEPTH = 10
"""How deep subroutines may be nested (of the maker's older drives; the manual does not say)."""
NOT_RUNNING, RUNNING, BAD_ADDRESS, STACK_FULL = 40, 41, 42, 43
NORMAL, TRACED, STEPPED, SILENT = 0, 1, 2, 3
"""How a program runs: EX's modes, and SILENT: a stepped one that has not come to its break point yet."""


@dataclass
class Frame:
    """Where a subroutine returns to, and the hold that it interrupted: for motion, or until a time. `ending`: it is
    the end of the program that waits for motion.
    """

    back: int
    waiting: bool = False
    hold_until: float = -inf
    ending: bool = False


class Interpreter:
    """The one program that a drive can run."""

    running: bool

    def __init__(self, device: MCodeDevice, period: float) -> None:
        self.device, self.period = device, period
        self.code: list[Action] = [self.finish]
        self.texts: list[str] = [""]
        self.index: dict[int, int] = {}
        self.running = self.paused = self.waiting = self.ending = False
        self.live = False
        self.mode = NORMAL
        self.next_at = inf
        self.pc = 0
        self.stack: list[Frame] = []
        self.handler: Argument | None = None
        self._hold_until = -inf
        self._handling = 0
        self._steps = 0
        self._break: tuple[int, int] | None = None
        self._passes = 0
        self._resume: Callable[[float], None] | None = None
        self._linked = False
        self.executed = 0

    # Starting and ending.

    def start(self, target: Argument | None, t: float, mode: int = NORMAL) -> None:
        """EX; a program that runs is left for it, as clients of real units rely on. Raises Fault (24, 30, 34, 42)."""
        address = self.device.program.resolve(target)
        self.device.memory.forget_local()
        self.device.clear_error()
        self.device.pending, self.device.memory.values["IF"] = "", 0
        self._begin(self._entry(address), t, mode)

    def call_idle(self, target: Argument | None, t: float) -> None:
        """Run a subroutine while no program runs (OE, trips); its RT ends it. Raises Fault."""
        entry = self._entry(self.device.program.resolve(target))
        self._begin(entry, t, NORMAL)
        self.stack.append(Frame(len(self.code) - 1))

    def _begin(self, entry: int, t: float, mode: int) -> None:
        self.running, self.paused, self.waiting, self.ending = True, False, False, False
        self.stack.clear()
        self._handling, self._hold_until, self._steps = 0, -inf, 0
        self._resume = None
        self._passes = 0
        if mode == STEPPED and self._break is not None:
            mode = SILENT
        self.pc, self.next_at, self.mode = entry, t, mode
        self._wake()

    def finish(self) -> None:
        """The program is over."""
        self.running = self.paused = self.waiting = self.ending = False
        self.stack.clear()
        self._handling = 0
        self.next_at = inf
        self._wake()

    def end(self, t: float) -> None:
        """E from outside: at once, or when the motion that is under way is over."""
        if self.running and not self.paused and self.device.axis.moving(t):
            self.ending = True
            self._wake()
        else:
            self.finish()

    def clear(self) -> None:
        """As it is at power-up: nothing runs, no handler, no break point."""
        self.finish()
        self.forget()
        self.handler, self._break = None, None

    def forget(self) -> None:
        """Program memory has changed: compile anew when something is started."""
        self._linked = False

    # Pausing and stepping.

    def pause(self, t: float) -> None:
        """PS: the motion slows down and stops too. Raises Fault (40)."""
        if not self.running:
            raise Fault(NOT_RUNNING)
        if not self.paused and self.device.axis.moving(t):
            self._resume = self.device.motor.pause(t)
        self.paused = True
        self._wake()

    def resume(self, t: float) -> None:
        """RS. Raises Fault (40, 41, and the motion's own where it may not begin again)."""
        if not self.paused:
            raise Fault(RUNNING if self.running else NOT_RUNNING)
        self.paused = False
        self.next_at = max(self.next_at, t)
        again, self._resume = self._resume, None
        self._wake()
        if again is not None:
            again(t)

    def drop_motion(self) -> None:
        """What asked for the motion that a pause has stopped is gone: RS does not take it up."""
        self._resume = None

    @property
    def stepping(self) -> bool:
        """Whether a program waits for the keys of single step."""
        return self.running and self.mode == STEPPED

    def step(self, key: str, t: float) -> None:
        """Space runs one line, Enter the rest, or up to the break point (manual 5.1.42)."""
        if not self.stepping:
            return
        if key == " ":
            self._steps += 1
        else:
            self.mode = NORMAL if self._break is None else SILENT
            self._passes = -int(self._at_break(self.pc))
        self.next_at = max(self.next_at, t)
        self._wake()

    def break_at(self, target: Argument | None, passes: int) -> None:
        """BP: step from a place on, when it has been come to so many times; None: nowhere. Raises Fault (30, 42)."""
        self._passes = 0
        self._break = None if target is None else (self.device.program.resolve(target), passes)

    def break_here(self) -> None:
        """BP alone: step from here on. Raises Fault (40)."""
        if not self.running:
            raise Fault(NOT_RUNNING)
        self.mode, self._steps = STEPPED, 0
        self._wake()

    def _at_break(self, pc: int) -> bool:
        return self._break is not None and self.index.get(self._break[0]) == pc

    def _breaks(self, pc: int) -> bool:
        """Whether stepping begins before this line."""
        if self._break is None or self.mode == STEPPED or not self._at_break(pc):
            return False
        self._passes += 1
        if self._passes < self._break[1]:
            return False
        self.mode, self._steps = STEPPED, 0
        self._wake()
        return True

    # Time.

    def run(self, until: float) -> None:
        """Execute the lines that are due at or before `until`, or up to the one that changes what else is due."""
        device, code, period = self.device, self.code, self.period
        if self.mode != NORMAL:
            self._run_shown(until)
            return
        count = 0
        while self.live and self.next_at <= until and not device.stale:
            count += 1
            at, pc = self.next_at, self.pc
            device.now = at
            self.pc = pc + 1
            self.next_at = at + period
            try:
                code[pc]()
            except Fault as fault:
                self._on_fault(fault)
        self.executed += count

    def _run_shown(self, until: float) -> None:
        """The same, line by line, each printed before it is executed (EX modes 1 and 2), and with break points."""
        device = self.device
        while self.live and self.mode != NORMAL and self.next_at <= until and not device.stale:
            device.now, pc = self.next_at, self.pc
            if self._breaks(pc):
                return
            if self.texts[pc] and self.mode != SILENT and not device.memory.values["LK"]:
                device.emit(self.texts[pc] + "\r\n")
            self.pc = pc + 1
            self.next_at = device.now + self.period
            self._steps -= self.mode == STEPPED
            self.executed += 1
            try:
                self.code[pc]()
            except Fault as fault:
                self._on_fault(fault)
            self._wake()

    @property
    def due(self) -> float:
        """When the next line is executed; infinite if none will be by itself."""
        return self.next_at if self.live else inf

    def wakes_at(self) -> float:
        """When a hold for motion, or the motion that a program's end waits for, is over."""
        if self.paused or not (self.waiting or self.ending):
            return inf
        return max(self.device.axis.settled_at(), self.next_at)

    def wake(self, t: float) -> None:
        """That time has come."""
        self.waiting = False
        self.next_at = max(self.next_at, t)
        if self.ending:
            self.finish()
        self._wake()

    def _wake(self) -> None:
        asleep = self.paused or self.waiting or self.ending or (self.mode == STEPPED and self._steps <= 0)
        self.live = self.running and not asleep
        self.device.stale = True

    # What lines do.

    def hold(self, milliseconds: int | None) -> None:
        """H: until the motion is over, or for a time."""
        now = self.device.now
        if milliseconds is None:
            if self.device.axis.settled_at() > now:
                self.waiting = True
                self._wake()
        else:
            self._hold_until = self.next_at = max(self.next_at, now + milliseconds / 1000)

    def branch(self, target: Argument | None) -> None:
        """Go on elsewhere. Raises Fault (30, 42)."""
        self.pc = self._place(target)

    def call(self, target: Argument | None) -> None:
        """Go on elsewhere until RT. Raises Fault (30, 42, 43)."""
        entry = self._place(target)
        self._push(Frame(self.pc))
        self.pc = entry

    def give_back(self) -> None:
        """RT. Raises Fault (43) where nothing was called."""
        if not self.stack:
            raise Fault(STACK_FULL, fatal=True)
        frame = self.stack.pop()
        if len(self.stack) < self._handling:
            self._handling = 0
        self.pc = frame.back
        if frame.waiting or frame.ending:
            self.waiting, self.ending = frame.waiting, frame.ending
            self._wake()
        elif frame.hold_until > self.next_at:
            self._hold_until = self.next_at = frame.hold_until

    def interrupt(self, target: Argument | None, t: float) -> None:
        """A trip: call its subroutine before the next line. Faults go to the drive's error register."""
        if target is None:
            return
        try:
            if not self.running:
                self.call_idle(target, t)
            else:
                entry = self._place(target)
                self._interrupt(entry, t)
        except Fault as fault:
            self._on_fault(fault)

    def _interrupt(self, entry: int, t: float) -> None:
        holding = self._hold_until > t
        self._push(Frame(self.pc, self.waiting, self._hold_until if holding else -inf, self.ending))
        if self.waiting or holding or self.ending:
            self.next_at, self._hold_until = t, -inf
        self.waiting = self.ending = False
        self.pc = entry
        self._wake()

    def on_error(self, t: float) -> bool:
        """Call the error handler, if one is declared and not at work already. Gives whether it was called."""
        if self.handler is None or self._handling:
            return False
        try:
            if self.running:
                self._interrupt(self._place(self.handler), t)
            else:
                self.call_idle(self.handler, t)
        except Fault:
            return False
        self._handling = len(self.stack)
        self.device.handled()
        return True

    def _on_fault(self, fault: Fault) -> None:
        """An error in a line: without a handler the next one follows, unless there is none to follow."""
        self.device.set_error(fault.code)
        if not self.on_error(self.device.now) and fault.fatal:
            self.finish()

    def _push(self, frame: Frame) -> None:
        if len(self.stack) >= STACK_DEPTH:
            raise Fault(STACK_FULL, fatal=True)
        self.stack.append(frame)

    # Compiling.

    def _entry(self, address: int) -> int:
        if not self._linked:
            self._link()
        return self.index[address]

    def _place(self, target: Argument | None) -> int:
        """Where the program that runs goes on. Raises Fault (30, 34, 42), 42 too for what was stored since it began."""
        address = self.device.program.resolve(target)
        if address not in self.index:
            raise Fault(BAD_ADDRESS, fatal=True)
        return self.index[address]

    def _link(self) -> None:
        """Compile program memory. Where a gap or the end of memory follows a line, the program is over."""
        self.code, self.texts, self.index = [], [], {}
        program, expected = self.device.program, None
        for address in program.order:
            line = program.lines[address]
            if expected not in (None, address):
                self._append(self.finish, "")
            expected = address + line.size
            self.index[address] = len(self.code)
            if line.statement.word != "LB":
                self._append(self.device.compile_line(line.statement), f"{address}  {line.text}")
        self._append(self.finish, "")
        self._linked = True

    def _append(self, action: Action, text: str) -> None:
        self.code.append(action)
        self.texts.append(text)
