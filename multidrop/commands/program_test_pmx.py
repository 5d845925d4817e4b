"""`multidrop program test` for A-SCRIPT: what programs switch, what fails, and a summary of X and Y."""

from __future__ import annotations

import argparse
import json
import sys
import time
from typing import Any

from dialects import Diagnostic
from dialects.pmx.manual import program_file
from shell.output import exit_code, report, write
from simulator.cell.spec import DriveSpec
from simulator.pmx.program_run import Failed, Output, ProgramRun, Summary

FAILED = 1
ENDS = {"END": "ended", "error": "ended by an error", "until": "stopped"}


def run(file: str, spec: DriveSpec, chosen: argparse.Namespace, several: bool) -> int:
    """Test one file; the exit code."""
    began = time.perf_counter()
    code = 0
    tell = _json if chosen.json else _told
    try:
        trial = ProgramRun(spec, program_file.load(file), file)
        if several and not chosen.json:
            write(sys.stdout, f"{file}:")
        for event in trial.run(chosen.run, chosen.until):
            if isinstance(event, Summary):
                code = FAILED if event.errors or event.given_up else 0
            tell(file, event, time.perf_counter() - began, several)
    except Diagnostic as problem:
        write(sys.stderr, report(problem))
        return exit_code(problem)
    except KeyboardInterrupt:
        write(sys.stderr, f"{file}: interrupted")
        raise
    return code


def _json(file: str, event: Output | Failed | Summary, real: float, several: bool) -> None:
    """An object a line. With several files each names its own."""
    fact: dict[str, Any] = {"file": file} if several else {}
    if isinstance(event, Output):
        fact |= {"t": round(event.t, 6), "program": event.program, "outputs": event.outputs}
    elif isinstance(event, Failed):
        fact |= {"t": round(event.t, 6), "program": event.program, "error": event.why, "line": event.line}
        fact |= {"handled": True} if event.handled else {}
    else:
        fact["summary"] = {
            "position": dict(zip("XY", event.position, strict=True)),
            "moves": event.moves,
            "errors": list(event.errors),
            "instructions": event.instructions,
            "virtual_s": round(event.t, 6),
            "real_s": round(real, 3),
            "ended": event.ended,
        }
    write(sys.stdout, json.dumps(fact))


def _told(file: str, event: Output | Failed | Summary, real: float, several: bool) -> None:
    """Lines for a person."""
    if isinstance(event, Output):
        write(sys.stdout, f"{event.t:10.4f}  DO={event.outputs} (program {event.program})")
    elif isinstance(event, Failed):
        handled = " (SUB 31 has handled it)" if event.handled else ""
        where = f"{file}:{event.line}: program {event.program} at {event.t:.4f} s"
        write(sys.stderr, f"{where}: {event.why}{handled}")
    else:
        write(sys.stdout, _sum(event, real))
        for line in event.lines or (0,):
            if remark := _remark(event):
                write(sys.stderr, f"{file}:{line}: {remark}" if line else f"{file}: {remark}")


def _sum(end: Summary, real: float) -> str:
    failed = "no errors" if not end.errors else f"{len(end.errors)} error{'s' if len(end.errors) > 1 else ''}"
    motions = f"{end.moves} motion{'' if end.moves == 1 else 's'}"
    facts = f"X {end.position[0]}, Y {end.position[1]}, {motions}, {end.instructions} compiled lines, {failed}"
    return f"{ENDS[end.ended]} after {end.t:.4f} s: {facts} ({real:.2f} s real)"


def _remark(end: Summary) -> str:
    """What a person should know of how it ended."""
    if end.stuck:
        return "the program waits here, and nothing will ever happen any more"
    if end.given_up:
        return "the program still runs; --until SECONDS says how long is long enough"
    if end.moving and end.ended == "END":
        return "a motor still turns; WAITX or WAITY before END waits for it"
    return ""
