"""`multidrop`, `demo`, `tui`, `shell`, `send`, `run` and `help`: the screen, the prompt, lines, scripts, words."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from functools import partial
from shlex import quote
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.on_demand import importing
from multidrop.shell import hooks
from multidrop.shell.hooks import Around, Prepare
from multidrop.shell.operations.argument_types import Agreeing, Opening, Reporting

if TYPE_CHECKING:
    from multidrop.dialects.language import Language
    from multidrop.shell.hooks import Added
    from multidrop.shell.session import Session


def shell(urls: Sequence[str], raw: bool, reconnect: bool, agreeing: Agreeing, added: Added) -> int:
    if sys.stdin.isatty():
        with importing():
            from multidrop.shell.prompt.prompt import run
        return run(
            urls,
            reconnect=reconnect,
            agreed=agreeing.yes,
            beyond=agreeing.beyond,
            raw=raw,
            prepare=added.prepare,
        )
    from multidrop.shell.batch import runner
    from multidrop.shell.prompt.terminal_input import run_stream

    async def lines(session: Session) -> None:
        await added.opened(session)
        await run_stream(session, descriptor=sys.stdin.fileno())

    return runner.run(urls, lines, watch_keys=False, agreed=agreeing.yes, beyond=agreeing.beyond, asks=False, raw=raw)


def send(url: str, lines: Sequence[str], json: bool, agreeing: Agreeing) -> int:
    with importing():
        from multidrop.shell.batch import runner
        from multidrop.shell.line_syntax import each_names_one_drive, targets
        from multidrop.shell.prompt.terminal_input import run_lines

    opened = partial(
        runner.run,
        [url],
        lazy=each_names_one_drive(lines),
        agreed=agreeing.yes,
        beyond=agreeing.beyond,
        asks=False,
        tried=targets(lines),
    )
    if not json:
        return opened(partial(run_lines, lines=lines))
    from multidrop.shell.batch.report import BatchReport
    from multidrop.shell.scripts.executor import run_typed

    report = BatchReport("send", as_json=True)

    async def body(session: Session) -> None:
        await run_typed(session, session.origin, lines, report.executed)

    return report.finish(opened(body, replies=False))


def run(file: str, opening: Opening, reporting: Reporting, agreeing: Agreeing) -> int:
    from multidrop.macros import MacroStore
    from multidrop.shell.batch.report import BatchReport
    from multidrop.shell.configuration import Settings
    from multidrop.shell.scripts.reading import read_script

    if not (opening.on or opening.role):
        raise Diagnostic("nothing to open", "multidrop run", "--on URL, or --role NAME=URL")
    report = BatchReport(file, as_json=reporting.json, junit=reporting.junit)
    try:
        report.begin()
        if file.endswith(".py"):
            from multidrop.commands import python_program

            return python_program.run(file, opening, reporting.json, agreeing, report)
        settings = Settings()
        macros = MacroStore(settings.macros, settings.project_macros)
        script = read_script(file, dict(opening.set), macros)
    except Diagnostic as problem:
        return report.refused(problem)
    from multidrop.shell.batch import runner
    from multidrop.shell.line_syntax import targets
    from multidrop.shell.scripts.executor import run_script
    from multidrop.shell.scripts.model import lines_of

    async def body(session: Session) -> None:
        await report.watched(session, opening.on, opening.role)
        with report.noting():
            await run_script(session, session.origin, script, report.executed)

    tried = targets(line.text for line in lines_of(script.body))
    agreed, replies = agreeing.yes, not reporting.json
    code = runner.run([], body, agreed=agreed, beyond=agreeing.beyond, asks=False, replies=replies, tried=tried)
    return report.finish(code)


def tui(urls: Sequence[str], raw: bool, reconnect: bool, added: Added) -> int:
    if (code := added.instead(bool(urls) or raw)) is not None:
        return code
    return screen(urls, reconnect, raw, added.prepare, added.around)


def screen(
    urls: Sequence[str],
    reconnect: bool = True,
    raw: bool = False,
    prepare: Prepare = hooks.nothing,
    around: Around = contextlib.nullcontext,
) -> int:
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise Diagnostic("the screen needs a terminal", hint="multidrop shell reads lines from anywhere")
    with importing():
        from multidrop.tui.launch import run

    return run(urls, reconnect, raw, prepare, around)


def help_(word: str, dialect: str | None) -> int:
    """Explain a word in the language that is named, or in the first that has it; name the others."""
    from multidrop.dialects.families import FAMILIES, languages
    from multidrop.shell.operations.table import load_others
    from multidrop.shell.streams.stdout import write
    from multidrop.shell.verbs.explaining import explained, overview

    lines: list[str] = []
    write(sys.stderr, *(f"warning: {warning}" for warning in load_others()))
    if dialect:
        language = FAMILIES[dialect].language
        lines = language.describe_error(int(word[:9])) if _is_number(word) else language.describe(word)
    elif word:
        having = [spoken for spoken in languages() if _has(spoken, word)]
        lines = explained(word, having[0] if having else None)
        others = {name: family.language for name, family in FAMILIES.items() if family.language in having[1:]}
        same = [name for name, spoken in others.items() if explained(word, spoken) == lines]
        lines = [
            *lines,
            *(f"also: multidrop help {quote(word)} --dialect {each}" for each in others if each not in same),
        ]
    for line in lines or overview():
        write(sys.stdout, line)
    return 0


def _is_number(word: str) -> bool:
    return word.isdecimal() and word.isascii()


def _has(language: Language, word: str) -> bool:
    """Whether a language has a word, or an error with that number."""
    if not _is_number(word):
        return language.knows(word)
    with contextlib.suppress(Diagnostic):
        return bool(language.describe_error(int(word[:9])))
    return False
