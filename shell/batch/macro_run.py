"""A macro that a command plays on buses that it opens."""

from __future__ import annotations

import sys
from collections.abc import Mapping

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, MacroStore, missing
from multidrop.shell.batch import runner
from multidrop.shell.batch.report import BatchReport
from multidrop.shell.configuration import Settings
from multidrop.shell.exit_codes import INTERRUPTED
from multidrop.shell.operations.argument_types import Agreeing, Opening, Reporting
from multidrop.shell.scripts.executor import play as play_macro
from multidrop.shell.scripts.reading import read_macro
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import write


def play(name: str, opening: Opening, times: int | None, fast: bool, reporting: Reporting, agreeing: Agreeing) -> int:
    """Play a macro; report wrong values and lines before anything is opened. What was checked is what plays."""
    if not (opening.on or opening.role):
        raise Diagnostic("nothing to open", "multidrop macro play", "--on URL, or --role NAME=URL")
    report = BatchReport(f"macro {name}", as_json=reporting.json, junit=reporting.junit)
    try:
        report.begin()
        settings, values = Settings(), dict(opening.set)
        store = MacroStore(settings.macros, settings.project_macros)
        macro = store.load(name)
        values |= _asked(macro, values)
        if hides := store.hides(macro.name):
            write(sys.stderr, hides)
        checked = read_macro(macro, values, store)
    except Diagnostic as problem:
        return report.refused(problem)
    except KeyboardInterrupt:
        return INTERRUPTED

    async def body(session: Session) -> None:
        await report.watched(session, opening.on, opening.role)
        with report.noting():
            await play_macro(
                session,
                session.origin,
                macro,
                values,
                times=times,
                fast=fast,
                checked=checked,
                executed=report.executed,
                ended=report.ended,
            )

    agreed, replies = agreeing.yes, not reporting.json
    code = runner.run([], body, agreed=agreed, beyond=agreeing.beyond, asks=False, replies=replies)
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
