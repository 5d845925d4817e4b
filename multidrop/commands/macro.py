"""`multidrop macro`: list, show and play macros."""

from __future__ import annotations

import argparse
import sys

from dialects import Diagnostic
from macros import MacroStore, checked_values, format_macro
from multidrop.commands.failure import fail
from shell.connect.settings import Settings
from shell.output import write


def list_(chosen: argparse.Namespace) -> int:
    """Print a line for each macro; one that cannot be read is reported and does not hide the others."""
    code = 0
    try:
        store = _store()
        for name in store.names():
            try:
                write(sys.stdout, store.load(name).summary)
            except Diagnostic as problem:
                code = fail(problem)
        for line in store.clashes():
            write(sys.stderr, line)
    except Diagnostic as problem:
        code = fail(problem)
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
    """Play a macro; report wrong values before anything is opened."""
    values = dict(chosen.set)
    try:
        macro = _store().load(chosen.name)
        checked_values(macro, values)
    except Diagnostic as problem:
        return fail(problem)
    from shell.front import batch

    return batch.run(chosen.on, lambda session: session.play(macro, values), agreed=chosen.yes, asks=False)


def _store() -> MacroStore:
    settings = Settings()
    return MacroStore(settings.macros, settings.project_macros)
