"""What may come in the middle of automation: a signal, and the stop key on the terminal that it runs on."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Callable, Iterator

from shell.front.keyboard import Keyboard, foreground_terminal

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
def on_stop_key(ahead: Callable[[], None], stop: Callable[[], None], gone: Callable[[], None]) -> Iterator[None]:
    """Watch the terminal that is standard input for the stop key.

    For each, `ahead` is called at once in another thread, and `stop` then in the event loop; `gone`, when the terminal
    hangs up. Does nothing where standard input is no terminal, or is one in whose background this process runs.
    """
    descriptor = foreground_terminal()
    if descriptor is None:
        yield
        return
    keyboard = Keyboard(descriptor, signals=True)
    keyboard.stop_ahead, keyboard.stop, keyboard.gone = ahead, lambda dropped: stop(), gone
    keyboard.listen(keyboard.forget)
    with keyboard:
        yield
