"""The end of the process while sessions are open: what they set in motion is stopped.

An uncaught exception ends the main thread, and with it what is still open. Signals such as SIGTERM would end a process
at once; where the program leaves them at that, they become a SystemExit, so that its `with` and `finally` blocks run.
So does the end of the reader of standard output, as in `python program.py | head`, with exit code 141.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import signal
import sys
import threading
from collections.abc import Callable

from multidrop.shell.exit_codes import READER_GONE
from multidrop.shell.signals import SIGNALS
from multidrop.shell.streams import stdout

SIGNALLED = 128
"""The exit code after a signal is this and its number."""


_open: dict[object, Callable[[], object]] = {}
"""The sessions that must not outlive the process, and what stops what each has started, and closes it."""
_handled: dict[int, Callable[..., object] | int | None] = {}


def opened(session: object, end: Callable[[], object]) -> None:
    """End a session with the process, unless it is `closed` before."""
    _open[session] = end
    if threading.current_thread() is threading.main_thread():
        for each in SIGNALS:
            if each not in _handled and signal.getsignal(each) is signal.SIG_DFL:
                _handled[each] = signal.signal(each, _exit)
        if signal.SIGTERM in _handled and stdout.watch is None:
            stdout.watch_reader(signal.SIGTERM)


def closing(session: object) -> None:
    """Note that a session is being closed: a reader that leaves does not interrupt the end of the last one."""
    if [*_open] == [session] and signal.SIGTERM in _handled:
        stdout.work_done()


def closed(session: object) -> None:
    """Forget a session; the last one gives the signals back."""
    flush_printed()
    _open.pop(session, None)
    if not _open and threading.current_thread() is threading.main_thread():
        for number, before in _handled.items():
            if signal.getsignal(number) is _exit:
                signal.signal(number, before)
        if signal.SIGTERM in _handled:
            stdout.work_done()
            stdout.watch = None
        _handled.clear()


def flush_printed() -> None:
    """Write what the program has printed: it comes before a report of its end, or a traceback."""
    with contextlib.suppress(OSError, ValueError, AttributeError):  # no reader, closed, or no standard output at all
        sys.stdout.flush()


def _exit(number: int, _: object) -> None:
    if stdout.reader_left():
        stdout.silence(sys.stdout)  # or the interpreter fails as it flushes
        raise SystemExit(READER_GONE)
    raise SystemExit(SIGNALLED + number)


def _end_all() -> None:
    for end in list(_open.values()):
        with contextlib.suppress(KeyboardInterrupt):
            end()


def _register() -> None:
    """Call `_end_all` at the end of the main thread, before that of the executors, which a closing needs.

    `atexit` calls later. What is registered last comes first, so the executors are registered before.
    """
    importlib.import_module("concurrent.futures.thread")
    getattr(threading, "_register_atexit", atexit.register)(_end_all)


_register()
