"""`multidrop program check`: what is wrong with program files, without running them.

What the text alone tells comes with line and column. An MCode file that passes is also loaded into a simulated drive,
which refuses what that drive would refuse.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from dialects import Diagnostic
from dialects.files import text_of
from dialects.problems import Problem
from dialects.sources import SOURCES, language_of
from shell.output import exit_code, report, write

WRONG = 1


@dataclass(frozen=True)
class Told:
    """What came of a file: what is wrong with it, and what it is."""

    problems: list[Problem]
    facts: str

    @property
    def right(self) -> bool:
        """Nothing but warnings."""
        return all(each.warning for each in self.problems)


def run(chosen: argparse.Namespace) -> int:
    """Check the files one after the other; the exit code, the highest one of them."""
    return max(_file(file, chosen) for file in chosen.files)


def _file(file: str, chosen: argparse.Namespace) -> int:
    try:
        told = examine(file, chosen.language or language_of(file), chosen.personality)
    except Diagnostic as problem:
        write(sys.stderr, report(problem))
        return exit_code(problem)
    for each in told.problems:
        kind = "warning" if each.warning else "error"
        if chosen.json:
            fact = {"file": file, "line": each.line, "column": each.column, kind: each.what, "hint": each.hint}
            write(sys.stdout, json.dumps({key: value for key, value in fact.items() if value != ""}))
        else:
            hint = f"; {each.hint}" if each.hint else ""
            write(sys.stderr, f"{each.where(file)}: {'warning: ' if each.warning else ''}{each.what}{hint}")
    errors = sum(not each.warning for each in told.problems)
    if chosen.json:
        write(sys.stdout, json.dumps({"file": file, "errors": errors, "summary": told.facts}))
    elif told.right:
        write(sys.stdout, f"{file}: {told.facts}")
    return 0 if told.right else WRONG


def examine(file: str, language: str, personality: str | None) -> Told:
    """Look through one file. Raises Diagnostic where it cannot be read."""
    text = text_of(file)
    source = SOURCES[language]
    problems = source.check(text)
    if any(not each.warning for each in problems):
        return Told(problems, "")
    loaded = LOADED.get(language)
    if loaded is not None:
        problems += loaded(file, personality)
    return Told(problems, f"nothing wrong, {source.measure(text)}")


def _refused(file: str, personality: str | None) -> Iterator[Problem]:
    """What a simulated drive refuses when the file is loaded."""
    from dialects.mcode import errors, programs
    from simulator.cell import DriveSpec
    from simulator.trial import Trial

    spec = DriveSpec() if personality is None else DriveSpec(personality=personality)
    for failed in Trial(spec, programs.load(file), file).refusals():
        yield Problem(
            failed.line, 1, f"{failed.text}: error {failed.code}, {errors.text(failed.code, spec.personality)}"
        )


LOADED: Mapping[str, Callable[[str, str | None], Iterator[Problem]]] = {"mcode": _refused}
"""What a drive of a language refuses beyond what the text tells."""
