"""The languages of edited files: the style of each part of a line, the check, the places where a program can begin."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Protocol

from multidrop.dialects import Diagnostic
from multidrop.dialects.program_files import Entry, Part, Problem, in_order
from multidrop.macros import parse_macro
from multidrop.shell.program_text import ProgramGrammar

_LINE = re.compile(r":(\d+)(?::(\d+))?\Z")
_TOML = re.compile(
    r'(?P<remark>#.*)|(?P<text>"(?:[^"\\]|\\.)*"?|\'[^\']*\'?)|(?P<label>^\s*\[.*\])|(?P<word>^\s*\w+(?=\s*=))'
)


class Grammar(Protocol):
    """The language of a file as an editor uses it."""

    @property
    def title(self) -> str:
        """The name of the language."""

    def parts(self, line: str) -> Sequence[Part]:
        """Return the parts of a line that have a style of their own."""

    def check(self, text: str, product: str) -> Sequence[Problem]:
        """Report every problem of a text for a product, in order. For a thread: it may take a tenth of a second."""

    def entries(self, text: str) -> Sequence[Entry]:
        """Return the places at which a program can begin."""


class MacroGrammar:
    """Macro files: TOML that holds a macro."""

    title = "macro"

    def __init__(self, file: str) -> None:
        self._file = file

    def parts(self, line: str) -> Sequence[Part]:
        """See `Grammar`."""
        return [Part(*found.span(), found.lastgroup or "") for found in _TOML.finditer(line)]

    def check(self, text: str, product: str) -> Sequence[Problem]:
        """See `Grammar`: the macro is read as it is when it is played."""
        try:
            macro = parse_macro(text, self._file)
            tuple(macro.parameters)
        except Diagnostic as problem:
            return in_order([_problem(problem)])
        return ()

    def entries(self, text: str) -> Sequence[Entry]:
        """See `Grammar`: a macro begins at its first step."""
        return ()


def _problem(problem: Diagnostic) -> Problem:
    found = _LINE.search(problem.where)
    line, column = (int(found[1]), int(found[2] or 1)) if found else (1, 1)
    return Problem(line, column, problem.message, problem.hint)


def grammar_of(file: str) -> Grammar:
    """The grammar of a file by its name."""
    return MacroGrammar(file) if file.lower().endswith(".toml") else ProgramGrammar(file)
