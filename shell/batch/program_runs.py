"""`multidrop program check|test`: errors in program files, and runs on a simulated drive in virtual time.

Prints, facts and summaries go to standard output, errors to standard error. With --json everything is an object on
standard output.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.text import counted
from multidrop.dialects.program_files import errors
from multidrop.shell.operations.argument_types import CheckOptions, Testing
from multidrop.shell.programs.checking import USUAL_PERSONALITY, Checked, examine, rewrite, to_run
from multidrop.shell.streams.stdout import fail, reader_left, shortened, write

if TYPE_CHECKING:
    from multidrop.simulator.cell.spec import DriveSpec

WRONG = FAILED = 1
"""The exit codes of files with errors, and of a test that failed."""
MOST_SHOWN_PROBLEMS = 100
"""The largest number of problems of a file that are shown."""


def check(files: Sequence[str], how: CheckOptions) -> int:
    """Check the files in turn; return the highest exit code."""
    reported = dict[str, tuple[str, str]]()
    personality = how.personality or USUAL_PERSONALITY
    if how.cell is not None:
        spec = drive(how.cell, None)
        personality, reported = spec.personality, {spec.personality: (spec.identity.version, spec.identity.part)}
    return max(_check_file(file, personality, how, reported) for file in files)


def _check_file(file: str, personality: str, how: CheckOptions, reported: Mapping[str, tuple[str, str]]) -> int:
    try:
        checked = examine(file, personality, how.language, reported)
        _report(checked, how.json)
        if how.format:
            rewrite(checked)
    except Diagnostic as problem:
        return fail(problem)
    if how.json:
        fact = {"file": checked.file, "errors": len(errors(checked.problems)), "summary": checked.facts}
        _write_fact({**fact, "formatted": checked.respelled} if how.format else fact)
    elif checked.right:
        count = counted(checked.respelled, "line")
        write(sys.stdout, f"{checked.file}: {checked.facts}" + (f"; {count} formatted" if how.format else ""))
    return 0 if checked.right else WRONG


def _report(checked: Checked, json: bool) -> None:
    """Write each problem; for a person MOST_SHOWN_PROBLEMS of them."""
    for problem in checked.problems if json else checked.problems[:MOST_SHOWN_PROBLEMS]:
        if json:
            kind = "warning" if problem.warning else "error"
            fact = {
                "file": checked.file,
                "line": problem.line,
                "column": problem.column,
                kind: problem.what,
                "hint": problem.hint,
            }
            _write_fact({key: value for key, value in fact.items() if value != ""})
        else:
            write(sys.stderr, shortened(problem.line_for(checked.file)))
    if not json and (more := len(checked.problems) - MOST_SHOWN_PROBLEMS) > 0:
        write(sys.stderr, f"{checked.file}: {counted(more, 'more problem')}, not shown")


def _write_fact(fact: Mapping[str, object]) -> None:
    import json

    write(sys.stdout, json.dumps(fact))


def test(files: Sequence[str], how: Testing) -> int:
    """Test the files in turn; return the highest exit code."""
    given = None if how.cell is None and how.personality is None else drive(how.cell, how.personality)
    return max(_test(file, how, given, len(files) > 1) for file in files)


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


def _test(file: str, how: Testing, given: DriveSpec | None, several: bool) -> int:
    from multidrop.simulator.families import PROGRAMS
    from multidrop.simulator.program_events import DebugWishes

    began = time.perf_counter()
    head = {"file": file} if several else {}
    debugging = DebugWishes(how.trace, how.breaks, how.watch)
    failed = False
    try:
        text, language = to_run(file, how.language)
        programs = PROGRAMS[language]
        loaded = programs.read(text, file)(given or programs.drive)
        if several and not how.json:
            write(sys.stdout, f"{file}:")
        for event in loaded.run(how.run, how.until, debugging):
            failed = failed or event.failed
            real = time.perf_counter() - began
            if how.json:
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
