"""A checked script: its steps as a tree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class ScriptLine:
    """A line without its comment, and its place. `file` is empty for a line of the command line."""

    file: str
    number: int
    text: str

    @property
    def where(self) -> str:
        """`file:line`."""
        return f"{self.file}:{self.number}"

    @property
    def word(self) -> str:
        """The first word."""
        return self.text.split(maxsplit=1)[0]


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


Node = Step | If | Repeat | CallFile


@dataclass(frozen=True)
class Script:
    """A script that was checked whole."""

    file: str
    body: Sequence[Node]
    values: Mapping[str, str]
    """The values of `--set`, which every called file has too."""
