"""A checked script or macro: its steps as a tree, and the result of each executed line."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from multidrop.macros import Macro
from multidrop.shell.operations.table import script_verb
from multidrop.shell.secrets import without_secrets
from multidrop.shell.waits import Standing


@dataclass(frozen=True)
class ScriptLine:
    """A line without its comment, and its place. `file` is empty for a line of the command line."""

    file: str
    number: int
    text: str
    macro: str = ""
    """The macro that it is a line of."""
    step: int = 0
    """Its step in the macro; 0 for an `on_early_end` line."""
    after: float = 0.0
    """The seconds after the start of the line before, with recorded timing."""

    @property
    def where(self) -> str:
        """`file:line`; for a line of a macro `macro NAME, step 3 (file:line)`."""
        place = f"{self.file}:{self.number}" if self.file else ""
        if not self.macro:
            return place
        step = f"step {self.step}" if self.step else "on_early_end"
        return f"macro {self.macro}, {step}" + (f" ({place})" if place else "")

    @property
    def word(self) -> str:
        return (self.text.split(maxsplit=1) or [""])[0]


@dataclass(frozen=True)
class ScriptStep:
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
    """`/repeat`, `/while` or `/until`, then `/end`."""

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


Node = ScriptStep | If | Repeat | CallFile | CallMacro


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
    on_early_end: Sequence[Node]
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
            yield from lines_of((*node.played.body, *node.played.on_early_end))


@dataclass(frozen=True)
class LineResult:
    """The result of one line. `sent` is the line with its values; `bus` and `drive` are empty for a verb."""

    line: ScriptLine
    sent: str
    time: datetime
    seconds: float
    printed: tuple[str, ...] = ()
    bus: str = ""
    drive: str = ""
    error: str = ""
    """Empty: the line succeeded."""
    failed_check: bool = False
    """The line is a check, and the check failed."""
    round: int = 0
    """The round of the macro, from 1; 0 for a line of a script."""

    @property
    def where(self) -> str:
        """The place of the line, with the round where that is not the first."""
        return self.line.where + (f", round {self.round}" if self.round > 1 else "")

    @property
    def reported(self) -> str:
        """The line for a report: a verb's URL without its secrets."""
        return without_secrets(self.sent) if self.sent.startswith("/") else self.sent

    @property
    def ok(self) -> bool:
        return not self.error

    @property
    def check(self) -> bool:
        verb = script_verb(self.line.word)
        return bool(self.line.where) and verb is not None and verb.script is not None and verb.script.verdict

    def fact(self) -> dict[str, Any]:
        """The result as an object for programs; what is empty is left out."""
        place: dict[str, Any] = {"file": self.line.file} if self.line.file else {}
        if self.line.macro:
            step = {"step": self.line.step, "round": self.round} if self.line.step else {"on_stop": True}
            place |= {"macro": self.line.macro, **step}
        where = {key: value for key, value in (("bus", self.bus), ("drive", self.drive)) if value}
        time = {"time": self.time.isoformat(timespec="milliseconds")}
        error = {"error": self.error} if self.error else {}
        fields = {"line": self.line.number, "sent": self.reported, "printed": list(self.printed), "ok": self.ok}
        return place | fields | where | time | error


Executed = Callable[[LineResult], None]
"""Takes the result of each line as it ends."""


@dataclass(frozen=True)
class MacroEnding:
    """The end of a macro."""

    macro: str
    rounds: int
    """The rounds that were done."""
    at: str = ""
    """The place where it ended early; empty: it played to its end."""
    standings: tuple[Standing, ...] = ()
    """The places of its drives after an early end."""

    def fact(self) -> dict[str, Any]:
        """The end as an object for programs."""
        early = (
            {"at": self.at, "drives": {standing.name: standing.fact for standing in self.standings}} if self.at else {}
        )
        return {"macro": self.macro, "rounds": self.rounds} | early


Ended = Callable[[MacroEnding], None]
"""Takes the end of a macro."""
