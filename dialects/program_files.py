"""Program files of a family: what is known by a file's name, and the language, imported at its first use."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol, cast

from multidrop.dialects.files import SourceLine
from multidrop.dialects.problems import Problem

if TYPE_CHECKING:
    from pathlib import Path

    from multidrop.dialects.program_editing import EditingLanguage


class Part(NamedTuple):
    """A part of a line, by columns from 0. `kind`: word, starts, label, text, remark or wrong.

    `starts`: a word that can start motion.
    """

    start: int
    stop: int
    kind: str


class Entry(NamedTuple):
    """A place at which a program can begin: its name, its line in the file from 1, and the command that starts it."""

    name: str
    line: int
    start: str


class FileLanguage(Protocol):
    """The language of program files: a module of a family's manual."""

    def load(self, path: str | Path) -> Sequence[SourceLine]:
        """Read the lines to download. Raises Diagnostic."""

    def read(self, text: str, name: str) -> Sequence[SourceLine]:
        """Read the lines of a text; `name` is the file's name in a Diagnostic. Raises Diagnostic."""

    def check(self, text: str, product: str = "") -> list[Problem]:
        """Report every error that the text shows, on a product where that matters."""

    def formatted(self, text: str) -> str:
        """Return a correct program in canonical spelling, with its remarks and its layout."""

    def measure(self, text: str) -> str:
        """Describe the length of a correct program. Raises Diagnostic for any other."""

    def parts(self, line: str) -> Sequence[Part]:
        """Return the parts of a line that an editor shows in another style. Never fails."""

    def entries(self, text: str) -> Sequence[Entry]:
        """Return the places at which a program of a file can begin."""


class ProgramFiles(NamedTuple):
    """The program files of a family."""

    title: str
    """The name of the language, for a person."""
    endings: tuple[str, ...]
    """The endings of the files' names."""
    module: str
    """The module that is the `FileLanguage`."""
    editing_module: str
    """The module that is the `EditingLanguage`."""
    ids: tuple[str, ...]
    """The names by which editors know the language."""

    @property
    def language(self) -> FileLanguage:
        """Load, check, format and measure."""
        return cast(FileLanguage, importlib.import_module(self.module))

    @property
    def editing(self) -> EditingLanguage:
        """Names, help and completion of a text under editing."""
        return cast("EditingLanguage", importlib.import_module(self.editing_module))
