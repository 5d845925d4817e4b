"""`multidrop program test`: what a program file does on a simulated drive, told as it happens and summed up.

What the drive prints and the summary go to standard output, errors to standard error; with --json everything is
objects on standard output.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from dialects import Diagnostic
from dialects.mcode.manual import errors, program_file
from dialects.sources import language_of
from multidrop.commands import program_test_pmx
from shell.output import exit_code, report, write
from simulator.cell import spec as cells
from simulator.cell.spec import DriveSpec
from simulator.lexium.program_run import Failed, Printed, ProgramRun, Summary

ENDS = {"E": "ended at E", "error": "ended by an error", "until": "stopped"}
FAILED = 1


def run(chosen: argparse.Namespace) -> int:
    """Test the files one after the other; the exit code, the highest one of them."""
    several = len(chosen.files) > 1
    try:
        given = None if chosen.cell is None and chosen.personality is None else drive(chosen.cell, chosen.personality)
    except Diagnostic as problem:
        return _told(problem)
    codes = []
    for file in chosen.files:
        usual, test = TESTS[chosen.language or language_of(file)]
        codes.append(test(file, given or usual, chosen, several))
    return max(codes)


def drive(cell: str | None, personality: str | None) -> DriveSpec:
    """The drive to test on: `CELL` where it has only one, else `CELL#BUS` or `CELL#BUS:NAME`. Raises Diagnostic.

    No CELL before the # is the demo cell, as in `sim:#press`. Without a cell it is an LMDCM in an empty world.
    """
    spec = DriveSpec() if cell is None else _placed(cell)
    return spec if personality is None else replace(spec, personality=personality)


def _placed(cell: str) -> DriveSpec:
    path, _, place = cell.partition("#")
    bus, _, name = place.partition(":")
    shop = cells.load(path) if path else cells.demo()
    where = path or "demo cell"
    state = [(each.name, spec) for each in shop.buses for spec in each.drives]
    found = [spec for of, spec in state if bus in ("", of) and name in ("", spec.name)]
    if len(found) == 1:
        return found[0]
    names = ", ".join(f"{path}#{of}:{spec.name}" for of, spec in state if not found or spec in found)
    what = f"{len(found)} drives could be meant" if found else "there is no such drive"
    raise Diagnostic(what, f"{where}#{place}" if place else where, f"--cell is one of {names}" if state else "")


def _test(file: str, spec: DriveSpec, chosen: argparse.Namespace, several: bool) -> int:
    began = time.perf_counter()
    teller: _Told | _Json = (_Json if chosen.json else _Told)(file, several)
    code = 0
    try:
        trial = ProgramRun(spec, program_file.load(file), file)
        for event in trial.run(chosen.run, chosen.until):
            if isinstance(event, Summary):
                teller.summary(event, time.perf_counter() - began)
                code = FAILED if event.errors or event.given_up else 0
            elif isinstance(event, Printed):
                teller.printed(event)
            else:
                teller.failed(event, spec.personality)
    except Diagnostic as problem:
        return _told(problem)
    except KeyboardInterrupt:
        write(sys.stderr, f"{file}: interrupted")
        raise
    return code


class _Json:
    """An object a line. With several files each names its own."""

    def __init__(self, file: str, several: bool) -> None:
        self._head: dict[str, Any] = {"file": file} if several else {}

    def printed(self, event: Printed) -> None:
        self._tell(t=_seconds(event.t), print=event.text)

    def failed(self, event: Failed, personality: str) -> None:
        more = {"handled": True} if event.handled else {}
        self._tell(t=_seconds(event.t), error=event.code, line=event.line, **more)

    def summary(self, end: Summary, real: float) -> None:
        self._tell(
            summary={
                "position": end.position,
                "moves": end.moves,
                "errors": list(end.errors),
                "instructions": end.instructions,
                "virtual_s": _seconds(end.t),
                "real_s": round(real, 3),
                "ended": end.ended,
            }
        )

    def _tell(self, **fact: Any) -> None:
        write(sys.stdout, json.dumps(self._head | fact))


class _Told:
    """Lines for a person."""

    def __init__(self, file: str, several: bool) -> None:
        self._file = file
        if several:
            write(sys.stdout, f"{file}:")

    def printed(self, event: Printed) -> None:
        write(sys.stdout, f"{event.t:10.4f}  {_visible(event.text)}")

    def failed(self, event: Failed, personality: str) -> None:
        when = "refused" if event.loading else f"at {event.t:.4f} s"
        what = f"error {event.code}, {errors.text(event.code, personality)}"
        handled = " (OE has handled it)" if event.handled else ""
        write(sys.stderr, f"{self._file}:{event.line}: {event.text}: {when}: {what}{handled}")

    def summary(self, end: Summary, real: float) -> None:
        failed = f"errors {', '.join(str(each) for each in end.errors)}" if end.errors else "no errors"
        facts = (f"position {end.position}", _count(end.moves, "motion"), _count(end.instructions, "line"), failed)
        how = "not run" if not end.line else f"{ENDS[end.ended]} after {end.t:.4f} s"
        write(sys.stdout, f"{how}: {', '.join(facts)} ({real:.2f} s real)")
        remark = _remark(end)
        if remark:
            write(sys.stderr, f"{self._file}:{end.line}: {remark}")


def _remark(end: Summary) -> str:
    """What a person should know of how it ended."""
    if end.stuck:
        return "the program waits here, and nothing will ever happen any more"
    if end.given_up:
        return "the program still runs; --until SECONDS says how long is long enough"
    if end.moving and end.ended == "E":
        return f"the motor still turns, {end.moving} steps/s; H before E waits for it"
    return ""


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _seconds(t: float) -> float:
    return round(t, 6)


def _visible(text: str) -> str:
    """A text that does nothing to a terminal."""
    return "".join(each if each.isprintable() or each == "\t" else f"\\x{ord(each):02x}" for each in text)


def _told(failure: BaseException) -> int:
    write(sys.stderr, report(failure))
    return exit_code(failure)


TESTS: Mapping[str, tuple[DriveSpec, Callable[[str, DriveSpec, argparse.Namespace, bool], int]]] = {
    "mcode": (DriveSpec(), _test),
    "pmx": (DriveSpec(personality="PMX", name="00"), program_test_pmx.run),
}
"""By language: the drive where nothing is said of it, and how a file is tested on one."""
