"""`multidrop macro`: list, show, play and change macros."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.files import bounded, utf8, why
from multidrop.macros import Macro, MacroStore, format_macro, missing
from multidrop.macros.store import begin_draft, finish_draft, listed
from multidrop.shell import macro_changes
from multidrop.shell.configuration import Settings
from multidrop.shell.exit_codes import INTERRUPTED
from multidrop.shell.streams.stdout import fail, write

if TYPE_CHECKING:
    from multidrop.shell.session import Session

INPUT = "standard input"


def list_(chosen: argparse.Namespace) -> int:
    """Print a line for each macro; one that cannot be read is reported and does not hide the others."""
    found = listed(_store())
    for line in found.lines:
        write(sys.stdout, line)
    code = max(map(fail, found.broken), default=0)
    for line in found.warnings:
        write(sys.stderr, line)
    return code


def show(chosen: argparse.Namespace) -> int:
    for line in format_macro(_store().load(chosen.name)).rstrip("\n").split("\n"):
        write(sys.stdout, line)
    return 0


def play(chosen: argparse.Namespace) -> int:
    """Play a macro; report wrong values and lines before anything is opened. What was checked is what plays."""
    from multidrop.shell.batch.report import Report
    from multidrop.shell.scripts.reading import read_macro

    if not (chosen.on or chosen.role):
        raise Diagnostic("nothing to open", "multidrop macro play", "--on URL, or --role NAME=URL")
    report = Report(f"macro {chosen.name}", as_json=chosen.json, junit=chosen.junit)
    try:
        report.begin()
        store, values = _store(), dict(chosen.set)
        macro = store.load(chosen.name)
        values |= _asked(macro, values)
        if hides := store.hides(macro.name):
            write(sys.stderr, hides)
        checked = read_macro(macro, values, store)
    except Diagnostic as problem:
        return report.refused(problem)
    except KeyboardInterrupt:
        return INTERRUPTED
    from multidrop.shell.batch import runner
    from multidrop.shell.scripts.executor import play as play_macro

    async def body(session: Session) -> None:
        await report.watched(session, chosen.on, chosen.role)
        with report.noting():
            given = {"times": chosen.times, "fast": chosen.fast, "checked": checked}
            await play_macro(session, macro, values, **given, executed=report.executed, ended=report.ended)

    code = runner.run([], body, agreed=chosen.yes, beyond=chosen.beyond, asks=False, replies=not chosen.json)
    return report.finish(code)


def _asked(macro: Macro, values: Mapping[str, str]) -> dict[str, str]:
    """Ask at the terminal for the values, if one is missing that must be given."""
    if not missing(macro, values):
        return {}
    from multidrop.shell.macro_arguments import value_fields
    from multidrop.shell.prompt import terminal_input

    if not terminal_input.can_ask():
        return {}
    return terminal_input.at_terminal(f"macro {macro.name}", value_fields(macro, values)) or {}


def _store() -> MacroStore:
    settings = Settings()
    return MacroStore(settings.macros, settings.project_macros)


def _run(command: list[str], otherwise: str) -> None:
    """Run an editor to its end; Ctrl+C is its own. Raises Diagnostic where it cannot run or fails."""
    import errno
    import shutil
    import subprocess

    before = signal.getsignal(signal.SIGINT)
    try:
        with subprocess.Popen(command) as process:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            code = process.wait()
    except OSError as problem:
        # A folder of the PATH that may not be read gives another reason than that there is no such program.
        error = problem if shutil.which(command[0]) else FileNotFoundError(errno.ENOENT, "")
        raise Diagnostic(f"cannot run ({why(error)})", command[0], f"set VISUAL or EDITOR; {otherwise}") from None
    finally:
        signal.signal(signal.SIGINT, before)
    if code:
        raise Diagnostic(f"the editor ended with {code}", command[0], f"{otherwise}; your text is in {command[-1]}")


def change(chosen: argparse.Namespace) -> int:
    """Change the macros, and say what was done on standard error: it is narration."""
    store = _store()
    try:
        for line in _changed(chosen, store):
            write(sys.stderr, line)
    except KeyboardInterrupt:
        return INTERRUPTED
    return 0


def _changed(chosen: argparse.Namespace, store: MacroStore) -> list[str]:
    match chosen.command:
        case "macro describe":
            return macro_changes.describe(store, chosen.name, " ".join(chosen.text))
        case "macro rename":
            return macro_changes.rename(store, chosen.name, chosen.new)
        case "macro copy":
            return macro_changes.copy(store, chosen.name, chosen.new, chosen.project)
        case "macro key":
            done, doubtful = macro_changes.set_key(store, chosen.key, chosen.name, chosen.page)
            return [done, *doubtful]
        case "macro export":
            return macro_changes.export(store, chosen.file, chosen.names, lambda line: write(sys.stdout, line))
        case "macro import" if chosen.file == "-":
            text = utf8(bounded(sys.stdin.buffer, INPUT), INPUT)
            return macro_changes.import_text(store, text, INPUT, chosen.force)
        case "macro import":
            return macro_changes.import_(store, chosen.file, chosen.force)
        case "macro delete":
            doomed = macro_changes.deletion(store, chosen.name)
            what = doomed.what
            agreed = chosen.yes
            if not agreed and sys.stdin.isatty() and sys.stderr.isatty():
                sys.stderr.write(f"macro delete {what}. Go on? [y/N] ")
                sys.stderr.flush()
                agreed = sys.stdin.readline().strip() in ("y", "Y")
            if not agreed:
                raise Diagnostic(f"{what}; nothing was deleted", "macro delete", "--yes agrees to it")
            return macro_changes.delete(store, doomed)
        case _:
            return _edited(chosen.name, store)


def _edited(name: str, store: MacroStore) -> list[str]:
    """Open a copy in the person's editor; put it in place of the macro once it is right."""
    command = macro_changes.editor()
    draft = begin_draft(store, Settings().macro_drafts, name)
    if draft.remark:
        write(sys.stderr, draft.remark)
    _run([*command, str(draft.file)], f"{name} is as it was")
    return [finish_draft(store, draft)]
