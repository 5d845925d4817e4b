"""`multidrop program convert`: a program file for other drives, each change named, and the differences of a run."""

from __future__ import annotations

import sys

from multidrop.base import new_file
from multidrop.base.text import counted
from multidrop.features.convert.conversion import convert
from multidrop.shell.batch.program_runs import WRONG
from multidrop.shell.streams.stdout import StatusLine, write

DIFFERS = 1
"""The exit code where a run beside the original differs."""
MOST_SHOWN_WORLDS = 10
"""The largest number of worlds with a difference that are shown."""


def run(file: str, to: str, personality: str | None, output: str, until: float) -> int:
    """Convert a file; 1: something cannot be converted, so nothing is written, or a run beside the original differs."""
    new_file.check(output, printed=True)
    converted = convert(file, to, personality)
    program, status = converted.found, StatusLine()
    for problem in program.refused:
        write(sys.stderr, problem.line_for(file))
    if program.refused:
        write(sys.stderr, f"{file}: nothing is written")
        return WRONG
    runs = []
    for run_of_both in converted.differences(until):
        runs.append(run_of_both)
        status.show(f"{counted(len(runs), 'world')} run")
    status.erase()
    new_file.write(output, program.text, lambda line: write(sys.stdout, line))
    differ = [both for both in runs if both[1]]
    stream = sys.stderr if output == new_file.STANDARD_OUTPUT else sys.stdout
    lines = [f"{change.where(file)}: {change.what}; {change.hint}" for change in program.changes]
    lines += [f"differs with {world}: {difference}" for world, difference in differ[:MOST_SHOWN_WORLDS]]
    lines += [f"and in {counted(len(differ) - MOST_SHOWN_WORLDS, 'more world')}"] if differ[MOST_SHOWN_WORLDS:] else []
    count = counted(len(program.changes), "change")
    beside = f"run beside each other in {counted(len(runs), 'world')}, {len(differ)} differ"
    write(stream, *lines, f"{converted.source} to {converted.target}{new_file.place(output)}: {count}; {beside}")
    return DIFFERS if differ else 0
