"""What may come in the middle of automation: a signal, and the stop key on the terminal that it runs on."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterator

STOP_KEY = b"\x18"
"""Ctrl+X: one control byte, which no slow link can deliver in pieces."""
SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextlib.contextmanager
def on_signals(callback: Callable[[], None]) -> Iterator[None]:
    """Call back, in the event loop, for every signal that means the end, instead of dying of it."""
    loop = asyncio.get_running_loop()
    handled = []
    for each in SIGNALS:
        with contextlib.suppress(NotImplementedError):  # a loop without signals: KeyboardInterrupt ends it
            loop.add_signal_handler(each, callback)
            handled.append(each)
    try:
        yield
    finally:
        for each in handled:
            loop.remove_signal_handler(each)


@contextlib.contextmanager
def on_stop_key(callback: Callable[[], None]) -> Iterator[None]:
    """Call back, in the event loop, whenever the stop key is pressed on the terminal that is standard input.

    Does nothing where standard input is no terminal, or is one in whose background this process runs.
    """
    if not _our_terminal():
        yield
        return
    import termios
    import tty

    loop, descriptor = asyncio.get_running_loop(), sys.stdin.fileno()

    def typed() -> None:
        try:
            data = os.read(descriptor, 1024)
        except OSError:
            data = b""
        if not data:
            loop.remove_reader(descriptor)  # the terminal hung up: SIGHUP tells of it
        if STOP_KEY in data:
            callback()

    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor, termios.TCSANOW)
    loop.add_reader(descriptor, typed)
    try:
        yield
    finally:
        loop.remove_reader(descriptor)
        with contextlib.suppress(termios.error):
            termios.tcsetattr(descriptor, termios.TCSANOW, before)


def _our_terminal() -> bool:
    try:
        descriptor = sys.stdin.fileno()
        return os.isatty(descriptor) and os.tcgetpgrp(descriptor) == os.getpgrp()
    except (AttributeError, OSError, ValueError):  # no descriptor, not our terminal, or a system without such
        return False
