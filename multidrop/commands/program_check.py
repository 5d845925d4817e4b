"""`multidrop program check`: find the errors in program files without running them, and format correct files."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.dialects.program_files import errors
from multidrop.shell.checking import Checked, examine, rewrite
from multidrop.shell.output import shortened, write

WRONG = 1
MOST = 100
"""The largest number of problems of a file that are shown."""


def run(chosen: argparse.Namespace) -> int:
    """Check the files in turn; return the highest exit code."""
    return max(_file(file, chosen) for file in chosen.files)


def _file(file: str, chosen: argparse.Namespace) -> int:
    try:
        checked = examine(file, chosen.personality, chosen.language)
        _report(checked, chosen.json)
        if chosen.format:
            rewrite(checked)
    except Diagnostic as problem:
        return fail(problem)
    _summarize(checked, chosen)
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
        write(sys.stderr, f"{checked.file}: {more} more problem{'' if more == 1 else 's'}, not shown")


def _summarize(checked: Checked, chosen: argparse.Namespace) -> None:
    """Write what the file is, and how many of its lines were rewritten."""
    if chosen.json:
        fact = {"file": checked.file, "errors": len(errors(checked.problems)), "summary": checked.facts}
        _write_fact({**fact, "formatted": checked.respelled} if chosen.format else fact)
    elif checked.right:
        count = f"{checked.respelled} line{'' if checked.respelled == 1 else 's'}"
        write(sys.stdout, f"{checked.file}: {checked.facts}" + (f"; {count} formatted" if chosen.format else ""))


def _write_fact(fact: Mapping[str, object]) -> None:
    import json

    write(sys.stdout, json.dumps(fact))
