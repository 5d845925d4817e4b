"""Interruptions of automation: signals, and the stop key on its terminal."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import sys
from collections.abc import Callable, Iterator

from multidrop.shell.front.keyboard import Keyboard, foreground_terminal
from multidrop.shell.signals import SIGNALS, early_ends


@contextlib.contextmanager
def on_signals(callback: Callable[[], None]) -> Iterator[None]:
    """Call back, in the event loop, for every signal that would end the process.

    A terminal that hangs up may send its signal twice. The second one must not cut off the end of the process.
    """
    loop = asyncio.get_running_loop()
    handled: list[int] = []
    came: set[int] = set()

    def call(number: int) -> None:
        came.add(number)
        callback()

    with early_ends():
        for each in SIGNALS:
            with contextlib.suppress(NotImplementedError):  # a loop without signals: KeyboardInterrupt ends it
                loop.add_signal_handler(each, call, each)
                handled.append(each)
        try:
            yield
        finally:
            for number in handled:
                loop.remove_signal_handler(number)
        if sys.platform != "win32" and signal.SIGHUP in came:
            signal.signal(signal.SIGHUP, signal.SIG_IGN)


@contextlib.contextmanager
def on_stop_key(
    ahead: Callable[[], None],
    stop: Callable[[], None],
    gone: Callable[[], None],
    continued: Callable[[Callable[[], None]], Callable[[], object]] | None = None,
) -> Iterator[Keyboard | None]:
    """Watch for the stop key on the terminal of standard input; yield its keyboard, which drops all other keys.

    For each stop key, another thread calls `ahead` at once; the event loop then calls `stop`. A hang-up calls `gone`.
    `continued`: see `Keyboard`.
    Yields None where standard input is not a terminal, or where this process runs in its background.
    """
    descriptor = foreground_terminal()
    if descriptor is None:
        yield None
        return
    keyboard = Keyboard(descriptor, signals=True)
    keyboard.stop_ahead, keyboard.stop, keyboard.gone = ahead, lambda dropped: stop(), gone
    keyboard.continued = continued
    keyboard.listen(keyboard.forget)
    with keyboard:
        yield keyboard
