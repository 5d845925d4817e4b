"""`multidrop program test`: run a program file on a simulated drive, and report what it does.

Prints and the summary go to standard output, errors to standard error. With --json every event is an object on standard
output.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.dialects.families import program_language_of
from multidrop.dialects.files import program_text_of
from multidrop.shell.connect import settings
from multidrop.shell.output import reader_left, write
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.families import PROGRAMS
from multidrop.simulator.program_run import Debugging, Line

FAILED = 1


def run(chosen: argparse.Namespace) -> int:
    """Test the files in turn; return the highest exit code."""
    several = len(chosen.files) > 1
    try:
        given = None if chosen.cell is None and chosen.personality is None else drive(chosen.cell, chosen.personality)
    except Diagnostic as problem:
        return fail(problem)
    return max(_test(file, chosen, given, several) for file in chosen.files)


def drive(cell: str | None, personality: str | None) -> DriveSpec:
    """Find the drive to test on: `CELL` if it has only one, else `CELL#BUS` or `CELL#BUS:NAME`. Raises Diagnostic.

    No CELL before the # means the demo cell, as in `sim:#press`. No cell means an LMDCM in empty surroundings.
    """
    spec = DriveSpec() if cell is None else cells.placed(cell, settings.load().allowed).spec
    return spec if personality is None else replace(spec, personality=personality)


def _test(file: str, chosen: argparse.Namespace, given: DriveSpec | None, several: bool) -> int:
    began = time.perf_counter()
    programs = PROGRAMS[chosen.language or program_language_of(file)]
    head = {"file": file} if several else {}
    debugging = Debugging(chosen.trace, chosen.breaks, chosen.watch)
    failed = False
    try:
        loaded = programs.read(program_text_of(file), file)(given or programs.drive)
        if several and not chosen.json:
            write(sys.stdout, f"{file}:")
        for event in loaded.run(chosen.run, chosen.until, debugging):
            failed = failed or event.failed
            real = time.perf_counter() - began
            if chosen.json:
                write(sys.stdout, json.dumps(head | event.fact(real)))
            else:
                _write_lines(event.lines(file, real))
    except Diagnostic as problem:
        return fail(problem)
    except KeyboardInterrupt:
        if not reader_left():
            write(sys.stderr, f"{file}: interrupted")
        raise
    return FAILED if failed else 0


def _write_lines(lines: Iterator[Line]) -> None:
    for line in lines:
        write(sys.stderr if line.problem else sys.stdout, line.text)
