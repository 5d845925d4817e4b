"""Start and end of the app in a terminal: its session, signals, and an orderly close."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from functools import partial

from textual.driver import Driver

from multidrop.base.errors import Diagnostic
from multidrop.base.on_demand import importing
from multidrop.shell.automation import stop_key_trial
from multidrop.shell.configuration import Settings
from multidrop.shell.console import swallows
from multidrop.shell.hooks import Around, Prepare, nothing
from multidrop.shell.session import Session
from multidrop.shell.signals import SIGNALS, early_ends, in_loop
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist


def run(
    urls: Sequence[str],
    reconnect: bool = True,
    raw: bool = False,
    prepare: Prepare = nothing,
    around: Around = nullcontext,
) -> int:
    """Show the URLs, a tab for each bus; without URLs, show the start page. Return the exit code.

    `reconnect`: lost buses are tried again. `raw`: the URLs are opened in raw mode. `prepare`: takes the
    session before a URL is opened. `around`: what is entered while the screen runs.

    Raises Diagnostic if there is no terminal, or if the configuration is wrong.
    """
    from multidrop.shell.configuration import load
    from multidrop.shell.prompt.keyboard import SWITCH

    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise Diagnostic("the screen needs a terminal", "tui", "multidrop shell reads lines from standard input")
    sys.setswitchinterval(SWITCH)
    with early_ends():
        return asyncio.run(_run(urls, load(lenient=True), reconnect, raw, prepare, around))


async def _run(
    urls: Sequence[str], settings: Settings, reconnect: bool, raw: bool, prepare: Prepare, around: Around
) -> int:
    with importing():
        from multidrop.shell.log.writer import begin
        from multidrop.shell.prompt.collector import at_rest, collected_at_rest
        from multidrop.shell.session import Session

    session = Session(settings, reconnect=reconnect, raw=raw)
    app: MultidropApp | None = None
    try:
        prepare(session)
        with collected_at_rest(partial(at_rest, session)):
            app = MultidropApp(session, urls, Assist(session, settings), driver(), settings.screen)
            app.stops_to_the_end = True
            begin(session)
            if swallows():
                session.doubted = stop_key_trial(session)
            with around(app):
                return await show(app)
    finally:
        await _leave(session)
        await session.close()
        if app is not None:
            release(app)


async def _leave(session: Session) -> None:
    """Stop what automation started, and report the outcome of that and of a latched stop.

    A terminal that is not read delays neither the stop nor the end.
    """
    from multidrop.shell import stop_report
    from multidrop.shell.automation import outcome, settled
    from multidrop.shell.macro_arguments import keep_unended
    from multidrop.shell.streams.stdout import finish, nonblocking, write

    if not session.automations.was_interrupted:
        session.interrupt()
    await session.automations.over(lambda text: write(sys.stderr, text))
    halts, stops = session.automations.interrupted, session.stops
    if halts or session.latched or session.busy:
        await settled(session)
    with nonblocking() as streams:
        for line in filter(None, (*outcome(session, halts), keep_unended(session))):
            write(sys.stderr, line)
        if session.latched:
            write(sys.stderr, f"stop: {stop_report.words(session.tally())}")
        await finish(streams, lambda: True)
        while stops != session.stops:  # the key came after the screen was gone
            stops = session.stops
            await settled(session)
            write(sys.stderr, f"stop: {stop_report.words(session.tally())}")
            await finish(streams, lambda: True)


def release(app: MultidropApp) -> None:
    """Give the terminal back, at the very end: until then the stop key works. Name what was typed and not sent."""
    from multidrop.shell.streams.stdout import write

    release = getattr(app._driver, "release", None)
    if release is not None:
        release()
    for line in app.leaving.named():
        write(sys.stderr, line)


async def show(app: MultidropApp) -> int:
    """Run an app until it ends; return its exit code, 1 if it crashed."""
    # On a hang-up, or another signal that ends a process, stop what automation moves, then end the app.
    loop = asyncio.get_running_loop()
    for number in SIGNALS:
        in_loop(loop, number, app.interrupted)
    if sys.platform != "win32":
        loop.add_signal_handler(signal.SIGHUP, _hung_up, app)
    await app.run_async()
    if app.return_value is None:
        app.boundary.end()
        return 1
    return app.return_value


def driver() -> type[Driver]:
    """Return the driver that finds the stop in the bytes."""
    from multidrop.tui.terminal.driver import Terminal

    return Terminal


def _hung_up(app: MultidropApp) -> None:
    """End after a hang-up, and let nothing wait for the terminal.

    The shell of the terminal ends, too, and then the system sends the signal again: it must not cut off the end.
    """
    app.interrupted()
    if sys.platform != "win32":
        asyncio.get_running_loop().remove_signal_handler(signal.SIGHUP)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with open(os.devnull, "r+b") as nowhere:
        for descriptor in (0, 1, 2):
            os.dup2(nowhere.fileno(), descriptor)
