"""Where the stop's thread cuts in: at any instruction of the code that it shares with the loop's thread.

Nothing is added to that code: while a cut-in is ahead, Python's tracing counts the instructions of the loop's thread.
A cut-in is aimed at a named point (a lock, a queue, a write, a discard, an await: `points` finds them in the source),
or at the n-th line from now. There the work of the stop's thread is done whole, as if the loop's thread had lost its
turn. Where the loop's side holds a lock, it is done as the lock is given back: the thread would wait for that.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from random import Random
from types import FrameType
from typing import Any

SHARED = {
    "multidrop.transports.pipe": ("Pipe", "DescriptorPipe"),
    "multidrop.drives.stopping": ("Stopping", "_read"),
    "multidrop.drives.link": ("Link",),
    "multidrop.drives.line": ("Line",),
    "multidrop.drives.roster": ("Roster",),
    "multidrop.shell.workspace": ("Workspace",),
    "multidrop.shell.session": ("Session", "LinePath"),
    "multidrop.shell.prompt.keyboard": ("Keyboard",),
    "multidrop.shell.prompt.line_queue": ("LineQueue",),
}
"""The modules that both threads run, and what of them they run: the other pipe is for Windows."""
OWN = {"DescriptorPipe.preempt", "Stopping.ahead", "Keyboard._run"}
"""What the keyboard's thread runs alone."""
LOCKS = {"_guard"}
QUEUES = {"_pending", "_queue", "_waiting", "_repeats", "_typed", "_background"}
STATES = {"_ahead", "_preempted", "_partial_until", "lost", "transport", "buses"}
"""Attributes that one thread sets and the other reads."""
WRITES = {"write", "discard", "drop", "unsent", "preempt", "yielded", "take_repeats"}
WRITING = ("pipe DescriptorPipe.write", "pipe DescriptorPipe._push", "link Link._write", "line Line._launch")
"""The points on the way of a line to the wire."""
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
            found[f"{module.rpartition('.')[2]} {name}{f' ({again + 1})' * bool(again)}"] = file, line
    return found


@dataclass(frozen=True)
class Aim:
    """Where a stop cuts in: at the n-th pass of a point (empty: at the n-th line), so many instructions further on."""

    point: str
    passes: int
    further: int


def drawn_aim(rng: Random) -> Aim:
    """Draw an aim."""
    further = int(rng.random() ** 2 * 16)
    if (choice := rng.random()) < 0.7:
        names = [each for each in points() if choice > 0.5 or each.startswith(WRITING)]
        return Aim(rng.choice(names), 1 + int(rng.random() ** 3 * 6), further)
    return Aim("", 1 + int(rng.random() ** 2 * 3000), further)


class CutIns:
    """The cut-ins of one world, one after the other. `passed` is called with the name of each point that is hit."""

    def __init__(self, passed: Callable[[str], None]) -> None:
        self._passed = passed
        self._files = {file for file, _ in points().values()}
        self._names = {place: name for name, place in points().items()}
        self._aim = Aim("", 0, 0)
        self._run: Callable[[], None] | None = None
        self._waiting: Callable[[], None] | None = None
        """The work of the stop's thread, which waits for a lock."""
        self._held = 0
        """Locks that the loop's side holds."""
        self._passes = self._further = 0
        self._before: Any = None

    def begin(self, aim: Aim, run: Callable[[], None]) -> None:
        """Call `run` at the aim, in place of what was to be called at the last one."""
        self.end()
        self._aim, self._run, self._passes, self._further = aim, run, aim.passes, -1
        self._before = sys.gettrace()
        sys.settrace(self._called)

    def end(self) -> None:
        """Cut in nowhere any more."""
        if self._run is not None:
            self._run = None
            sys.settrace(self._before)

    # Locks

    def lock(self) -> CutIns:
        """A lock of the code that is shared."""
        return self

    def __enter__(self) -> None:
        self._held += 1

    def __exit__(self, *_: object) -> None:
        self._held -= 1
        if not self._held and self._waiting is not None:
            run, self._waiting = self._waiting, None
            run()

    # The loop's thread

    def _called(self, frame: FrameType, event: str, argument: Any) -> Any:
        if self._run is None or frame.f_code.co_filename not in self._files:
            return None
        frame.f_trace_opcodes = True
        return self._traced

    def _traced(self, frame: FrameType, event: str, argument: Any) -> Any:
        if self._run is None:
            return None
        if event == "line" and self._passes > 0:
            name = self._names.get((frame.f_code.co_filename, frame.f_lineno), "")
            if not self._aim.point or name == self._aim.point:
                self._passes -= 1
                if not self._passes:
                    self._further = self._aim.further
                    self._passed(name or "a line between two points")
        elif event == "opcode" and not self._passes:
            self._further -= 1
            if self._further < 0:
                run = self._run
                self.end()
                if self._held:
                    self._waiting = run
                else:
                    run()
        return self._traced
