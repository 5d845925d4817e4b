"""The signals that end a process early: automation stops what it moved. Signals of a fault are not among them."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from asyncio import AbstractEventLoop

if sys.platform == "win32":
    from multidrop.shell.console import end_with_console


def _existing(*names: str) -> tuple[signal.Signals, ...]:
    """The signals of this platform among those named."""
    return tuple(signal.Signals[name] for name in names if hasattr(signal, name))


FROM_TERMINAL = _existing("SIGINT", "SIGHUP", "SIGQUIT", "SIGBREAK")
"""A terminal sends these to all processes of a job. SIGBREAK is the end of a console of Windows, too."""
SIGNALS = (*FROM_TERMINAL, *_existing("SIGTERM", "SIGALRM", "SIGUSR1", "SIGUSR2", "SIGXCPU"))
"""All but SIGPIPE: see `early_ends`."""


@contextlib.contextmanager
def early_ends() -> Iterator[None]:
    """Within this block SIGNALS may be given handlers; on Linux, SIGPIPE counts as SIGTERM."""
    if sys.platform == "win32":
        end_with_console()
    before = {each: signal.getsignal(each) for each in SIGNALS}
    with _pipe_taken():
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


@contextlib.contextmanager
def _pipe_taken() -> Iterator[None]:
    """Send SIGTERM for each SIGPIPE to the process. Enter it before other threads start: they block the signal, too.

    Python ignores SIGPIPE, because a broken socket sends it. Linux sends that one to the thread whose write failed.
    There it stays blocked, and a thread that waits gets those to the process. Other systems send both to the process.
    """
    if sys.platform != "linux":
        yield
        return
    pipe, over = {signal.SIGPIPE}, threading.Event()

    def wait() -> None:
        while signal.sigwait(pipe) and not over.is_set():
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)  # which may sleep

    mask = signal.pthread_sigmask(signal.SIG_BLOCK, pipe)
    taker = threading.Thread(target=wait, daemon=True, name="signals")
    taker.start()
    try:
        yield
    finally:
        over.set()
        signal.pthread_kill(taker.ident or 0, signal.SIGPIPE)
        taker.join()
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def in_loop(loop: AbstractEventLoop, number: int, callback: Callable[[], object]) -> Callable[[], object]:
    """Call a function in an event loop for each signal of a number; call what is returned to end that."""
    if sys.platform != "win32":
        loop.add_signal_handler(number, callback)
        return lambda: loop.remove_signal_handler(number)
    # The loop there takes no signals, but one wakes it.
    before = signal.signal(number, lambda *_: loop.call_soon_threadsafe(callback))
    return lambda: signal.signal(number, before)


class Interruption:
    """Takes the signals within its block, in the main thread. Those that come outside of `open` wait for it."""

    def __init__(self) -> None:
        self.came = False
        self._open = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            self._before = {each: signal.signal(each, self._take) for each in SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @contextmanager
    def open(self) -> Iterator[None]:
        """Raise KeyboardInterrupt for a signal, within this block."""
        self._open = True
        try:
            if self.came:
                raise KeyboardInterrupt
            yield
        finally:
            self._open = False

    def _take(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        if self._open:
            self._open = False
            raise KeyboardInterrupt
