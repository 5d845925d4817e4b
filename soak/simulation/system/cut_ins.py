"""Where the stop's thread cuts in: at any instruction of the code that it shares with the loop's thread.

Nothing is added to that code: while a cut-in is ahead, Python's tracing counts the instructions of the loop's thread.
A cut-in is aimed at a named point (a lock, a queue, a write, a discard, an await: `points` finds them in the source),
or at the n-th line from now. There the stop's thread takes its turn, and may be held up at any instruction of its own
while the loop's thread goes on. Who finds a lock taken waits until the other gives it back.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Collection, Iterator
from contextvars import Context
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from random import Random
from types import FrameType
from typing import Any

from soak.simulation.system.beside import Beside, Lock
from soak.simulation.system.clock import SimulatedLoop

SHARED = {
    "multidrop.transports.pipe": ("Pipe", "DescriptorPipe"),
    "multidrop.features.usb.pipe": ("UsbPipe",),
    "multidrop.drives.stop_ahead": ("StopAhead",),
    "multidrop.drives.stopping": ("Stopping", "_read"),
    "multidrop.drives.link": ("Link",),
    "multidrop.drives.line": ("Line",),
    "multidrop.drives.roster": ("Roster",),
    "multidrop.shell.workspace": ("Workspace",),
    "multidrop.shell.session": ("Session", "VerbPath"),
    "multidrop.shell.line_path": ("LinePath", "LinePassage"),
    "multidrop.shell.prompt.keyboard": ("Keyboard",),
    "multidrop.shell.prompt.line_queue": ("LineQueue",),
}
"""The modules that both threads run, and what of them they run: the other pipe is for Windows."""
OWN = {
    *("DescriptorPipe.preempt", "DescriptorPipe.follow", "UsbPipe.preempt", "UsbPipe.follow", "Stopping.ahead"),
    *("StopAhead.press", "StopAhead._begin", "StopAhead._again", "StopAhead._pace", "StopAhead._go_on"),
    *("StopAhead._next", "StopAhead._take_back", "StopAhead._due_piece", "StopAhead._of_the_loop", "Keyboard._run"),
}
"""What the keyboard's thread runs alone."""
CALLED = {"multidrop.features.usb.pipe": "usb"}
"""The names of modules in those of points, where the last word of the module is another one's."""
LOCKS = {"_guard"}
QUEUES = {"_pending", "_queue", "_waiting", "_repeats", "_typed", "_background"}
STATES = {"_begun", "_preempted", "_partial_until", "lost", "transport", "buses"}
"""Attributes that one thread sets and the other reads."""
WRITES = {"write", "discard", "drop", "unsent", "preempt", "yielded", "take_repeats", "take"}
WRITING = (
    "pipe DescriptorPipe.write",
    "pipe DescriptorPipe._push",
    "usb UsbPipe.write",
    "usb UsbPipe._next",
    "link Link._write",
    "line Line._launch",
)
"""The points on the way of a line to the wire."""
STEP, STEPS = ("line", 8) if sys.version_info[:2] == (3, 12) else ("opcode", 1)
"""What is counted, and how many instructions it stands for. Python 3.12 crashes where instructions are traced."""
HELD = 0.02
"""The longest time, s, for which the stop's thread is held up while the loop waits."""
OWN_WORK = 1500
"""The instructions of the stop's thread on a machine of two lines, about."""
UP = "the stop's thread is held up"
LATEST = 0.3
"""The time, s, after which a stop comes although its point was not passed."""


def _named(node: ast.AST) -> bool:
    """Whether a node of the source is a point."""
    match node:
        case ast.With(items=[ast.withitem(context_expr=ast.Attribute(attr=name))]):
            return name in LOCKS
        case ast.Await() | ast.AsyncFor() | ast.AsyncWith():
            return True
        case ast.Call(func=ast.Name(id="insort")):
            return True
        case ast.Call(func=ast.Attribute(attr=name, value=owner)):
            return name in WRITES or (isinstance(owner, ast.Attribute) and owner.attr in QUEUES)
        case ast.Attribute(attr=name, ctx=ast.Store()) | ast.Subscript(value=ast.Attribute(attr=name), ctx=ast.Store()):
            return name in QUEUES | STATES
    return False


def _found(node: ast.AST, name: str, only: Collection[str], line: str = "") -> Iterator[tuple[str, int]]:
    """The points below a node, by name, with the lines of their statements."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            inner = f"{name}.{child.name}".lstrip(".")
            if child.name != "__init__" and inner not in OWN and (name or child.name in only):
                yield from _found(child, inner, only)
        elif name:
            text = ast.unparse(child).splitlines()[0] if isinstance(child, ast.stmt) else line
            if _named(child):
                yield f"{name}: {text}", child.lineno  # type: ignore[attr-defined]
            yield from _found(child, name, only, text)


@cache
def points() -> dict[str, tuple[str, int]]:
    """The file and the line of every point, by its name."""
    found: dict[str, tuple[str, int]] = {}
    for module, only in SHARED.items():
        file = import_module(module).__file__
        assert file is not None
        with open(file, encoding="utf-8") as source:
            tree = ast.parse(source.read())
        lines = dict.fromkeys(_found(tree, "", only))
        for name, line in lines:
            again = sum(each == name and other < line for each, other in lines)
            found[f"{CALLED.get(module) or module.rpartition('.')[2]} {name}{f' ({again + 1})' * bool(again)}"] = (
                file,
                line,
            )
    return found


@dataclass(frozen=True)
class Aim:
    """Where a stop cuts in: at the n-th pass of a point (empty: at the n-th line), so many instructions further on.

    `own`, `others`: after so many instructions of its own it is held up for so many of the loop's; 0: it is not.
    """

    point: str
    passes: int
    further: int
    own: int = 0
    others: int = 0


def drawn_aim(rng: Random, usb: bool = False) -> Aim:
    """Draw an aim. `usb`: there is a controller on USB."""
    further = int(rng.random() ** 2 * 16)
    held = (1 + int(rng.random() ** 2 * OWN_WORK), 1 + int(rng.random() ** 2 * 3000)) if rng.random() < 0.5 else (0, 0)
    if (choice := rng.random()) < 0.7:
        names = [each for each in points() if choice > 0.5 or each.startswith(WRITING)]
        names = [each for each in names if usb or not each.startswith("usb ")]
        return Aim(rng.choice(names), 1 + int(rng.random() ** 3 * 6), further, *held)
    return Aim("", 1 + int(rng.random() ** 2 * 3000), further, *held)


class CutIns:
    """The cut-ins of one world, one after the other. `passed` is called with the name of each point that is hit."""

    def __init__(self, passed: Callable[[str], None], loop: SimulatedLoop | None = None) -> None:
        self.thread: Beside | None = None
        """The stop's thread, once it has cut in."""
        self.deadlocks: dict[str, None] = {}
        """Waits for a lock that would never end, each once."""
        self._passed, self._loop = passed, loop
        self._files = {file for file, _ in points().values()}
        self._names = {place: name for name, place in points().items()}
        self._aim = Aim("", 0, 0)
        self._run: Callable[[], None] | None = None
        self._passes = self._further = self._own = 0
        self._before: Any = None

    def lock(self) -> Lock:
        """A lock of the code that is shared."""
        return Lock(lambda: self.thread, lambda problem: self.deadlocks.update({problem: None}))

    def begin(self, aim: Aim, work: Callable[[], None]) -> None:
        """Let the stop's thread do work at the aim, in place of what it was to do at the last one."""
        self.hurry()
        self._trace(aim, lambda: self._cut_in(aim, work))

    def _trace(self, aim: Aim, run: Callable[[], None]) -> None:
        self.end()
        self._aim, self._run, self._passes, self._further = aim, run, aim.passes, -1
        self._before = sys.gettrace()
        sys.settrace(self._called)

    def end(self) -> None:
        """Cut in nowhere any more."""
        if self._run is not None:
            self._run = None
            sys.settrace(self._before)

    def hurry(self) -> None:
        """Let the stop's thread do the rest of its work, unless it waits for a lock."""
        if (thread := self.thread) is not None and not (thread.over or thread.runs or thread.waits):
            self.end()
            thread.go()

    def kill(self) -> None:
        """End with the process: the stop's thread does nothing more."""
        self.end()
        if self.thread is not None:
            self.thread.kill()

    # The loop's thread

    def _called(self, frame: FrameType, event: str, argument: Any) -> Any:
        if self._run is None or frame.f_code.co_filename not in self._files:
            return None
        frame.f_trace_opcodes = STEP == "opcode"
        return self._traced

    def _traced(self, frame: FrameType, event: str, argument: Any) -> Any:
        if self._run is None:
            return None
        if event == "line" and self._passes > 0:
            name = self._names.get((frame.f_code.co_filename, frame.f_lineno), "")
            if not self._aim.point or name == self._aim.point:
                self._passes -= 1
                if not self._passes:
                    self._further = self._aim.further // STEPS
                    self._passed(name or "a line between two points")
        if event == STEP and not self._passes:
            self._further -= 1
            if self._further < 0:
                run = self._run
                self.end()
                run()
        return self._traced

    def _cut_in(self, aim: Aim, work: Callable[[], None]) -> None:
        self.thread = thread = Beside(lambda: self._beside(work))
        self._own = -(-aim.own // STEPS)
        thread.go()
        if not thread.over and thread.waits is None and self._run is None:  # held up
            self._trace(Aim("", 1, aim.others), self.hurry)

    # The stop's thread

    def _beside(self, work: Callable[[], None]) -> None:
        sys.settrace(self._called_beside)
        try:
            work()
        finally:
            sys.settrace(None)

    def _called_beside(self, frame: FrameType, event: str, argument: Any) -> Any:
        if not self._own or frame.f_code.co_filename not in self._files:
            return None
        frame.f_trace_opcodes = STEP == "opcode"
        return self._traced_beside

    def _traced_beside(self, frame: FrameType, event: str, argument: Any) -> Any:
        if event == STEP and self._own:
            self._own -= 1
            if not self._own and self.thread is not None:
                self._passed(UP)
                if self._loop is not None:
                    self._loop.call_later(HELD, self.hurry, context=Context())
                self.thread.rest()
        return self._traced_beside
