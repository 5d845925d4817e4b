"""`multidrop program check`: find the errors in program files without running them.

Errors in the text have line and column. A simulated drive then loads the correct lines and refuses what that drive
would refuse, so that one run reports everything. An error that only follows from another one is not reported.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dialects import Diagnostic
from dialects.families import program_language_of, program_languages
from dialects.files import text_of
from dialects.problems import Problem, errors, in_order
from multidrop.commands.failure import fail
from shell.output import shortened, write
from simulator.families import PROGRAMS

WRONG = 1


@dataclass(frozen=True)
class Checked:
    """The problems of a file, and its description."""

    problems: list[Problem]
    facts: str

    @property
    def right(self) -> bool:
        """True if there is nothing but warnings."""
        return not errors(self.problems)


def run(chosen: argparse.Namespace) -> int:
    """Check the files in turn; return the highest exit code."""
    return max(_file(file, chosen) for file in chosen.files)


def _file(file: str, chosen: argparse.Namespace) -> int:
    try:
        checked = examine(file, chosen.language or program_language_of(file), chosen.personality)
    except Diagnostic as problem:
        return fail(problem)
    for each in checked.problems:
        kind = "warning" if each.warning else "error"
        if chosen.json:
            fact = {"file": file, "line": each.line, "column": each.column, kind: each.what, "hint": each.hint}
            _write_fact({key: value for key, value in fact.items() if value != ""})
        else:
            hint = f"; {each.hint}" if each.hint else ""
            text = f"{each.where(file)}: {'warning: ' if each.warning else ''}{each.what}{hint}"
            write(sys.stderr, shortened(text))
    if chosen.json:
        wrong = len(errors(checked.problems))
        _write_fact({"file": file, "errors": wrong, "summary": checked.facts})
    elif checked.right:
        write(sys.stdout, f"{file}: {checked.facts}")
    return 0 if checked.right else WRONG


def _write_fact(fact: Mapping[str, object]) -> None:
    import json

    write(sys.stdout, json.dumps(fact))


def examine(file: str, language: str, personality: str) -> Checked:
    """Check one file. Raises Diagnostic if it cannot be read."""
    text = text_of(file)
    source = program_languages()[language].language
    problems = source.check(text, personality)
    problems = in_order([*problems, *_refusals(text, file, language, personality, problems)])
    return Checked(problems, "" if errors(problems) else f"nothing wrong, {source.measure(text)}")


def _refusals(text: str, file: str, language: str, personality: str, found: Sequence[Problem]) -> list[Problem]:
    """Find what a simulated drive refuses beyond the problems that the text alone shows."""
    refusals = PROGRAMS[language].refusals
    return refusals(text, file, personality, found) if refusals is not None else []
