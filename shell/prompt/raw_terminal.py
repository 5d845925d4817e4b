"""A terminal that passes on every byte as it is typed, restored at the end (POSIX only)."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
import signal
import struct
import sys
import termios
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

assert sys.platform != "win32"


Continued = Callable[[Callable[[], None]], Callable[[], object]]
"""Calls a function, in the event loop, after each SIGCONT; the function returned ends that."""


def in_loop(callback: Callable[[], None]) -> Callable[[], object]:
    """Call a function after each SIGCONT, where the event loop runs in the main thread."""
    loop = asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGCONT, callback)
    return partial(loop.remove_signal_handler, signal.SIGCONT)


@contextlib.contextmanager
def hold(descriptor: int, signals: bool, continued: Continued = in_loop) -> Iterator[int]:
    """Make a terminal pass on every byte as it is typed, also after SIGCONT; restore it at the end.

    Yield the number of bytes typed before, which wait to be read. Linux has put a NUL among them for each Ctrl+D.

    With `signals` the terminal stays unchanged while this process is in the background. Without, the system stops the
    process there until it is in the foreground.
    """
    with contextlib.suppress(termios.error):  # else it has hung up; the next read reports that
        before = termios.tcgetattr(descriptor)
        held = [*before[:6], list(before[6])]  # without flow control, echo, line editing and suspension
        held[0] &= ~(termios.IXON | termios.IXOFF | termios.ICRNL | termios.INLCR | termios.IGNCR)
        held[3] &= ~(termios.ECHO | termios.ICANON | termios.IEXTEN)
        if not signals:
            held[3] &= ~termios.ISIG
        held[6][termios.VMIN], held[6][termios.VTIME] = 1, 0
        for key in (termios.VSUSP, termios.VQUIT):  # a process that is suspended or dumps core stops no drive
            held[6][key] = bytes([os.fpathconf(descriptor, "PC_VDISABLE")])

    def put(settings: list[Any], anywhere: bool) -> None:
        with contextlib.suppress(termios.error):
            if anywhere or in_foreground(descriptor):
                termios.tcsetattr(descriptor, termios.TCSANOW, settings)

    put(held, not signals)
    leave = continued(partial(put, held, not signals))
    try:
        yield _waiting(descriptor)
    finally:
        leave()
        put(before, False)


def _waiting(descriptor: int) -> int:
    with contextlib.suppress(OSError):
        return int(struct.unpack("i", fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)))[0])
    return 0


def in_foreground(descriptor: int) -> bool:
    """True if the descriptor is a terminal with this process in its foreground."""
    try:
        return os.isatty(descriptor) and os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:
        return False
