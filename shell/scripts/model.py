"""A checked script or macro: its steps as a tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from multidrop.macros import Macro


@dataclass(frozen=True)
class ScriptLine:
    """A line without its comment, and its place. `file` is empty for a line of the command line."""

    file: str
    number: int
    text: str
    macro: str = ""
    """The macro that it is a line of."""
    step: int = 0
    """Its step in the macro; 0 for an `on_stop` line."""
    after: float = 0.0
    """The seconds after the start of the line before, with recorded timing."""

    @property
    def where(self) -> str:
        """`file:line`; for a line of a macro `macro NAME, step 3 (file:line)`."""
        place = f"{self.file}:{self.number}" if self.file else ""
        if not self.macro:
            return place
        step = f"step {self.step}" if self.step else "on_stop"
        return f"macro {self.macro}, {step}" + (f" ({place})" if place else "")

    @property
    def word(self) -> str:
        """The first word."""
        return (self.text.split(maxsplit=1) or [""])[0]


@dataclass(frozen=True)
class Step:
    """One line to execute."""

    line: ScriptLine


@dataclass(frozen=True)
class If:
    """`/if`, `/else`, `/end`."""

    line: ScriptLine
    body: Sequence[Node]
    otherwise: Sequence[Node]


@dataclass(frozen=True)
class Repeat:
    """`/repeat`, `/end`."""

    line: ScriptLine
    body: Sequence[Node]


@dataclass(frozen=True)
class CallFile:
    """`/call FILE`."""

    line: ScriptLine
    script: Script


@dataclass(frozen=True)
class CallMacro:
    """`/call MACRO` or `/play MACRO`."""

    line: ScriptLine
    played: MacroScript
    times: int | None = 1
    fast: bool = False


Node = Step | If | Repeat | CallFile | CallMacro


@dataclass(frozen=True)
class Script:
    """A script that was checked whole."""

    file: str
    body: Sequence[Node]
    values: Mapping[str, str]
    """The values of `--set`, which every called file has too."""


@dataclass(frozen=True)
class MacroScript:
    """A macro that was checked whole."""

    macro: Macro
    body: Sequence[Node]
    on_stop: Sequence[Node]
    """Each of them is executed, whatever became of the one before it."""
    values: Mapping[str, str]
    """The values that it takes."""


def lines_of(body: Sequence[Node]) -> Iterator[ScriptLine]:
    """All lines of a body, those of other files and macros included."""
    for node in body:
        yield node.line
        if isinstance(node, If | Repeat):
            yield from lines_of(node.body)
        if isinstance(node, If):
            yield from lines_of(node.otherwise)
        elif isinstance(node, CallFile):
            yield from lines_of(node.script.body)
        elif isinstance(node, CallMacro):
            yield from lines_of((*node.played.body, *node.played.on_stop))
