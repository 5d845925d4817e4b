"""`multidrop macro`: list, show and play macros."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.macros import Macro, MacroStore, format_macro, missing
from multidrop.macros.store import listed
from multidrop.shell.connect.settings import Settings
from multidrop.shell.output import INTERRUPTED, write

if TYPE_CHECKING:
    from multidrop.shell.front.report import Report
    from multidrop.shell.session import Session


def list_(chosen: argparse.Namespace) -> int:
    """Print a line for each macro; one that cannot be read is reported and does not hide the others."""
    try:
        found = listed(_store())
    except Diagnostic as problem:
        return fail(problem)
    for line in found.lines:
        write(sys.stdout, line)
    code = max(map(fail, found.broken), default=0)
    for line in found.warnings:
        write(sys.stderr, line)
    return code


def show(chosen: argparse.Namespace) -> int:
    """Print a macro in the form of its file."""
    try:
        for line in format_macro(_store().load(chosen.name)).rstrip("\n").split("\n"):
            write(sys.stdout, line)
    except Diagnostic as problem:
        return fail(problem)
    return 0


def play(chosen: argparse.Namespace) -> int:
    """Play a macro; report wrong values and lines before anything is opened."""
    from multidrop.shell.front.report import Report
    from multidrop.shell.scripts.reading import WrongScript, read_macro

    if not (chosen.on or chosen.role):
        return fail(Diagnostic("nothing to open", "multidrop macro play", "--on URL, or --role NAME=URL"))
    report = Report(f"macro {chosen.name}", as_json=chosen.json, junit=chosen.junit)
    try:
        report.begin()
        store, values = _store(), dict(chosen.set)
        macro = store.load(chosen.name)
        values |= _asked(macro, values)
        if hides := store.hides(macro.name):
            write(sys.stderr, hides)
        read_macro(macro, values, store)
    except WrongScript as wrong:
        report.wrong(wrong.problems)
        return max(map(fail, wrong.problems))
    except Diagnostic as problem:
        report.wrong((problem,))
        return fail(problem)
    except KeyboardInterrupt:
        return INTERRUPTED
    return report.finish(_play(chosen, macro, values, report))


def _asked(macro: Macro, values: Mapping[str, str]) -> dict[str, str]:
    """Ask at the terminal for the values, if one is missing that must be given."""
    if not missing(macro, values):
        return {}
    from multidrop.shell.front import terminal_input
    from multidrop.shell.macro_arguments import value_fields

    if not terminal_input.can_ask():
        return {}
    return terminal_input.at_terminal(f"macro {macro.name}", value_fields(macro, values)) or {}


def _play(chosen: argparse.Namespace, macro: Macro, values: Mapping[str, str], report: Report) -> int:
    from multidrop.shell.front import batch
    from multidrop.shell.scripts.executor import play

    async def body(session: Session) -> None:
        await report.watched(session, chosen.on, chosen.role)
        with report.noting():
            await play(session, macro, values, times=chosen.times, fast=chosen.fast, watcher=report)

    return batch.run([], body, agreed=chosen.yes, asks=False, replies=not chosen.json)


def _store() -> MacroStore:
    settings = Settings()
    return MacroStore(settings.macros, settings.project_macros)
