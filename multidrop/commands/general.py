"""The commands: each takes what was asked for, imports what it needs, and gives the exit code."""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
from typing import TYPE_CHECKING

from dialects import Diagnostic
from shell.output import exit_code, finish, nonblocking, report, write

if TYPE_CHECKING:
    from macros import Macro, MacroStore
    from shell.session import Session


def start(chosen: argparse.Namespace) -> int:
    """Bare `multidrop`: the start screen."""
    return _screen([])


def demo(chosen: argparse.Namespace) -> int:
    """The screen on the demo cell."""
    return _screen(["sim:"])


def tui(chosen: argparse.Namespace) -> int:
    """The screen with what the URLs name."""
    return _screen(chosen.urls)


def _screen(urls: list[str]) -> int:
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return _told(Diagnostic("the screen needs a terminal", hint="multidrop shell reads lines from anywhere"))
    from tui.launch import run

    return run(urls)


def shell(chosen: argparse.Namespace) -> int:
    """The prompt, or lines from standard input."""
    if sys.stdin.isatty():
        from shell.front.prompt import run

        return run(chosen.urls)
    from shell.front import batch
    from shell.front.scripts import run_stream

    return batch.run(chosen.urls, lambda session: run_stream(session, sys.stdin.fileno()), watch_keys=False)


def send(chosen: argparse.Namespace) -> int:
    """Run lines and print the replies."""
    from shell.front import batch
    from shell.front.scripts import run_lines

    return batch.run([chosen.url], lambda session: run_lines(session, chosen.lines))


def run(chosen: argparse.Namespace) -> int:
    """Run a script."""
    from shell.front import batch
    from shell.front.scripts import read_script, run_script

    try:
        lines = read_script(chosen.script, dict(chosen.set))
    except Diagnostic as problem:
        return _told(problem)
    return batch.run(chosen.on, lambda session: run_script(session, lines))


def sim(chosen: argparse.Namespace) -> int:
    """Serve a simulated cell until a signal ends it, whether or not its output is read."""
    return asyncio.run(_sim(chosen))


async def _sim(chosen: argparse.Namespace) -> int:
    from simulator.serving.command import serve

    with nonblocking() as streams:
        try:
            await serve(chosen.cell, json=chosen.json, speed=chosen.speed, stdin=sys.stdin, stdout=sys.stdout)
        except Diagnostic as problem:
            return _told(problem)
        finally:
            await finish(streams, lambda: True)
    return 0


def macro_list(chosen: argparse.Namespace) -> int:
    """The macros, a line each; one that cannot be read is told of and does not hide the others."""
    from shell.verbs.macros import summary

    code = 0
    try:
        store = _store()
        for name in store.names():
            try:
                write(sys.stdout, summary(store.load(name)))
            except Diagnostic as problem:
                code = _told(problem)
        for line in store.clashes():
            write(sys.stderr, line)
    except Diagnostic as problem:
        code = _told(problem)
    return code


def macro_show(chosen: argparse.Namespace) -> int:
    """A macro as its file has it."""
    from macros import dump

    try:
        write(sys.stdout, dump(_store().load(chosen.name)).rstrip("\n"))
    except Diagnostic as problem:
        return _told(problem)
    return 0


def macro_play(chosen: argparse.Namespace) -> int:
    """Play a macro; wrong values are found before anything is opened."""
    from macros import lines
    from shell.front import batch

    values = dict(chosen.set)
    try:
        macro = _store().load(chosen.name)
        lines(macro, values)
    except Diagnostic as problem:
        return _told(problem)
    return batch.run(chosen.on, lambda session: _play(session, macro, values))


async def _play(session: Session, macro: Macro, values: dict[str, str]) -> None:
    from shell.verbs.macros import play_through

    await play_through(session, macro, values)


def _store() -> MacroStore:
    from macros import MacroStore
    from shell.connect.settings import Settings

    return MacroStore(Settings().macros)


def program_test(chosen: argparse.Namespace) -> int:
    """Run program files on a simulated drive, in virtual time."""
    from multidrop.commands.program_test import run

    return run(chosen)


def program_check(chosen: argparse.Namespace) -> int:
    """Tell what is wrong with program files."""
    from multidrop.commands.program_check import run

    return run(chosen)


def program_list(chosen: argparse.Namespace) -> int:
    """Print the program in a drive."""
    from multidrop.commands.program_drive import list_

    return list_(chosen)


def program_upload(chosen: argparse.Namespace) -> int:
    """Keep the program in a drive in a file."""
    from multidrop.commands.program_drive import upload

    return upload(chosen)


def program_download(chosen: argparse.Namespace) -> int:
    """Put a program file into a drive."""
    from multidrop.commands.program_drive import download

    return download(chosen)


def plot(chosen: argparse.Namespace) -> int:
    """Plot until interrupted."""
    from shell.plots.plotting import run

    return run(chosen.url, chosen.drive, to=chosen.to, serve=chosen.serve)


def ports(chosen: argparse.Namespace) -> int:
    """The serial ports of this machine."""
    from transports.listing import list_ports

    found = list_ports()
    for port in found:
        if chosen.json:
            fact = {"port": port.device, "stable": port.stable_name, "description": port.description}
            write(sys.stdout, json.dumps(fact))
        else:
            write(sys.stdout, "  ".join(part for part in (port.device, port.stable_name, port.description) if part))
    if not found and not chosen.json:
        write(sys.stderr, "no serial port was found; multidrop demo needs none")
    return 0


def _told(failure: BaseException) -> int:
    write(sys.stderr, report(failure))
    return exit_code(failure)
