"""`multidrop program check|test`: find the errors in program files; run them on a simulated drive in virtual time.

Prints, facts and summaries go to standard output, errors to standard error. With --json everything is an object on
standard output.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.text import counted
from multidrop.dialects.program_files import errors
from multidrop.shell.programs.checking import Checked, examine, rewrite, to_run
from multidrop.shell.streams.stdout import fail, reader_left, shortened, write

if TYPE_CHECKING:
    from multidrop.simulator.cell.spec import DriveSpec

WRONG = 1
MOST = 100
"""The largest number of problems of a file that are shown."""


def check(chosen: argparse.Namespace) -> int:
    """Check the files in turn; return the highest exit code."""
    reported = dict[str, tuple[str, str]]()
    if chosen.cell is not None:
        spec = drive(chosen.cell, None)
        chosen.personality, reported = spec.personality, {spec.personality: (spec.identity.version, spec.identity.part)}
    return max(_check_file(file, chosen, reported) for file in chosen.files)


def _check_file(file: str, chosen: argparse.Namespace, reported: Mapping[str, tuple[str, str]]) -> int:
    try:
        checked = examine(file, chosen.personality, chosen.language, reported)
        _report(checked, chosen.json)
        if chosen.format:
            rewrite(checked)
    except Diagnostic as problem:
        return fail(problem)
    if chosen.json:
        fact = {"file": checked.file, "errors": len(errors(checked.problems)), "summary": checked.facts}
        _write_fact({**fact, "formatted": checked.respelled} if chosen.format else fact)
    elif checked.right:
        count = counted(checked.respelled, "line")
        write(sys.stdout, f"{checked.file}: {checked.facts}" + (f"; {count} formatted" if chosen.format else ""))
    return 0 if checked.right else WRONG


def _report(checked: Checked, json: bool) -> None:
    """Write each problem; for a person MOST of them."""
    for each in checked.problems if json else checked.problems[:MOST]:
        if json:
            kind = "warning" if each.warning else "error"
            fact = {"file": checked.file, "line": each.line, "column": each.column, kind: each.what, "hint": each.hint}
            _write_fact({key: value for key, value in fact.items() if value != ""})
        else:
            write(sys.stderr, shortened(each.line_for(checked.file)))
    if not json and (more := len(checked.problems) - MOST) > 0:
        write(sys.stderr, f"{checked.file}: {counted(more, 'more problem')}, not shown")


def _write_fact(fact: Mapping[str, object]) -> None:
    import json

    write(sys.stdout, json.dumps(fact))


FAILED = 1


def test(chosen: argparse.Namespace) -> int:
    """Test the files in turn; return the highest exit code."""
    several = len(chosen.files) > 1
    given = None if chosen.cell is None and chosen.personality is None else drive(chosen.cell, chosen.personality)
    return max(_test(file, chosen, given, several) for file in chosen.files)


def drive(cell: str | None, personality: str | None) -> DriveSpec:
    """Find the drive to test on: `CELL` if it has only one, else `CELL#BUS` or `CELL#BUS:NAME`. Raises Diagnostic.

    No CELL before the # means the demo cell, as in `sim:#press`. No cell means an LMDCM in empty surroundings.
    """
    from dataclasses import replace

    from multidrop.shell import configuration
    from multidrop.simulator import cells
    from multidrop.simulator.cell.spec import DriveSpec

    spec = DriveSpec() if cell is None else cells.placed(cell, configuration.load().allowed).spec
    return spec if personality is None else replace(spec, personality=personality)


def _test(file: str, chosen: argparse.Namespace, given: DriveSpec | None, several: bool) -> int:
    from multidrop.simulator.families import PROGRAMS
    from multidrop.simulator.program_events import Debugging

    began = time.perf_counter()
    head = {"file": file} if several else {}
    debugging = Debugging(chosen.trace, chosen.breaks, chosen.watch)
    failed = False
    try:
        text, language = to_run(file, chosen.language or "")
        programs = PROGRAMS[language]
        loaded = programs.read(text, file)(given or programs.drive)
        if several and not chosen.json:
            write(sys.stdout, f"{file}:")
        for event in loaded.run(chosen.run, chosen.until, debugging):
            failed = failed or event.failed
            real = time.perf_counter() - began
            if chosen.json:
                _write_fact(head | event.fact(real))
            else:
                for line in event.lines(file, real):
                    write(sys.stderr if line.problem else sys.stdout, line.text)
    except Diagnostic as problem:
        return fail(problem)
    except KeyboardInterrupt:
        if not reader_left():
            write(sys.stderr, f"{file}: interrupted")
        raise
    return FAILED if failed else 0
