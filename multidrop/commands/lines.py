"""`multidrop`, `demo`, `tui`, `shell`, `send`, `run` and `help`: the screen, the prompt, lines, scripts, words."""

from __future__ import annotations

import argparse
import contextlib
import sys
from functools import partial
from shlex import quote
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.on_demand import importing
from multidrop.shell import hooks
from multidrop.shell.hooks import Around, Prepare

if TYPE_CHECKING:
    from multidrop.dialects.language import Language
    from multidrop.shell.session import Session


def shell(chosen: argparse.Namespace) -> int:
    if sys.stdin.isatty():
        with importing():
            from multidrop.shell.prompt.prompt import run
        return run(
            chosen.urls,
            reconnect=not chosen.no_reconnect,
            agreed=chosen.yes,
            beyond=chosen.beyond,
            raw=chosen.raw,
            prepare=partial(hooks.prepare, chosen=chosen),
        )
    from multidrop.shell.batch import runner
    from multidrop.shell.prompt.terminal_input import run_stream

    async def lines(session: Session) -> None:
        await hooks.opened(session, chosen)
        await run_stream(session, descriptor=sys.stdin.fileno())

    return runner.run(
        chosen.urls, lines, watch_keys=False, agreed=chosen.yes, beyond=chosen.beyond, asks=False, raw=chosen.raw
    )


def send(chosen: argparse.Namespace) -> int:
    with importing():
        from multidrop.shell.batch import runner
        from multidrop.shell.line_syntax import each_names_one_drive, targets
        from multidrop.shell.prompt.terminal_input import run_lines

    lazy, tried = each_names_one_drive(chosen.lines), targets(chosen.lines)
    if not chosen.json:
        lines = partial(run_lines, lines=chosen.lines)
        return runner.run(
            [chosen.url], lines, lazy=lazy, agreed=chosen.yes, beyond=chosen.beyond, asks=False, tried=tried
        )
    from multidrop.shell.batch.report import Report
    from multidrop.shell.scripts.executor import run_typed

    report = Report("send", as_json=True)

    async def body(session: Session) -> None:
        await run_typed(session, chosen.lines, report.executed)

    code = runner.run(
        [chosen.url], body, lazy=lazy, agreed=chosen.yes, beyond=chosen.beyond, asks=False, replies=False, tried=tried
    )
    return report.finish(code)


def run(chosen: argparse.Namespace) -> int:
    from multidrop.macros import MacroStore
    from multidrop.shell.batch.report import Report
    from multidrop.shell.configuration import Settings
    from multidrop.shell.scripts.reading import read_script

    if not (chosen.on or chosen.role):
        raise Diagnostic("nothing to open", "multidrop run", "--on URL, or --role NAME=URL")
    report = Report(chosen.script, as_json=chosen.json, junit=chosen.junit)
    try:
        report.begin()
        if chosen.script.endswith(".py"):
            from multidrop.commands import python_program

            return python_program.run(chosen, report)
        settings = Settings()
        macros = MacroStore(settings.macros, settings.project_macros)
        script = read_script(chosen.script, dict(chosen.set), macros)
    except Diagnostic as problem:
        return report.refused(problem)
    from multidrop.shell.batch import runner
    from multidrop.shell.line_syntax import targets
    from multidrop.shell.scripts.executor import run_script
    from multidrop.shell.scripts.model import lines_of

    async def body(session: Session) -> None:
        await report.watched(session, chosen.on, chosen.role)
        with report.noting():
            await run_script(session, script, report.executed)

    tried = targets(each.text for each in lines_of(script.body))
    return report.finish(
        runner.run([], body, agreed=chosen.yes, beyond=chosen.beyond, asks=False, replies=not chosen.json, tried=tried)
    )


def start(chosen: argparse.Namespace) -> int:
    return _screen([])


def demo(chosen: argparse.Namespace) -> int:
    return _screen(["sim:"])


def tui(chosen: argparse.Namespace) -> int:
    if (code := hooks.instead(chosen)) is not None:
        return code
    prepare, around = partial(hooks.prepare, chosen=chosen), partial(hooks.around, chosen=chosen)
    return _screen(chosen.urls, not chosen.no_reconnect, chosen.raw, prepare, around)


def _screen(
    urls: list[str],
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


def help_(chosen: argparse.Namespace) -> int:
    """Explain a word in the language that is named, or in the first that has it; name the others."""
    from multidrop.dialects.families import FAMILIES, languages
    from multidrop.shell.operations.table import load_others
    from multidrop.shell.streams.stdout import write
    from multidrop.shell.verbs.session import explained, overview

    word, lines = chosen.word, []
    write(sys.stderr, *(f"warning: {each}" for each in load_others()))
    if chosen.dialect:
        language = FAMILIES[chosen.dialect].language
        lines = language.describe_error(int(word[:9])) if _is_number(word) else language.describe(word)
    elif word:
        having = [each for each in languages() if _has(each, word)]
        lines = explained(word, having[0] if having else None)
        others = {name: family.language for name, family in FAMILIES.items() if family.language in having[1:]}
        same = [name for name, each in others.items() if explained(word, each) == lines]
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
