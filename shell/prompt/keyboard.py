"""The keys of the terminal of standard input, and the stop key ahead of all of them.

A held terminal echoes nothing and passes on every byte: no flow control (Ctrl+S), no line editing, no literal-next. A
thread looks for Ctrl+X in the bytes as they come, before any parser and any queue. That thread writes the stop itself,
whatever the event loop does.

Signals and the stop key interrupt automation.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import select
import signal
import sys
import threading
from codecs import getincrementaldecoder
from collections.abc import Callable, Iterator
from functools import partial

from multidrop.base.isolation import isolated
from multidrop.shell.signals import SIGNALS, early_ends
from multidrop.shell.signals import in_loop as on_signal

if sys.platform == "win32":
    from multidrop.shell.console import Console, is_console
else:
    from multidrop.shell.prompt.raw_terminal import hold, in_foreground, in_loop

STOP_KEY = b"\x18"
"""Ctrl+X: one control byte, which no slow link can split."""
STOP = STOP_KEY.decode()
END_OF_INPUT = b"\x04"
"""Ctrl+D."""
MOST_KEYS_AT_ONCE = 64
"""The characters passed on in one turn of the event loop: the stop key waits for no more than these."""
READ_BYTES = 4096
SWITCH = 0.0005
"""The time after which the loop's thread yields to the reading thread, s: the next bytes may hold a stop."""


class Keyboard:
    """The keys of a terminal. Enter it in the event loop; it keeps what is typed until a listener takes it.

    `signals`: Ctrl+C stays the terminal's interrupt.
    """

    def __init__(self, descriptor: int, signals: bool) -> None:
        self.descriptor = descriptor
        self.closed = False
        """The terminal is gone."""
        self.stop_ahead: Callable[[], None] = lambda: None
        """Called at once, in another thread, for every read that holds the stop key; `stop` follows."""
        self.stop: Callable[[str], None] = lambda dropped: None
        """Called, in the event loop, for every read that holds the stop key, with the text before the last one.
        That text is dropped; text after it is kept."""
        self.gone: Callable[[], None] = lambda: None
        """Called once, when the terminal hangs up."""
        self.continued: Callable[[Callable[[], None]], Callable[[], object]] | None = None
        """Calls a function after each SIGCONT; None: the event loop does, in the main thread."""
        self._signals = signals
        self._typed = ""
        self._early = 0
        """Bytes still to be read that were typed before the terminal was held."""
        self._decoder = getincrementaldecoder("utf-8")("replace")
        self._listener: Callable[[], object] | None = None
        self._loop = asyncio.get_running_loop()
        self._held = contextlib.ExitStack()

    def __enter__(self) -> Keyboard:
        sys.setswitchinterval(SWITCH)
        if sys.platform == "win32":
            self._held.enter_context(Console(self.descriptor, self._came, lambda: None, self._signals))
        else:
            held = hold(self.descriptor, self._signals, self.continued or in_loop)
            self._early = self._held.enter_context(held)
            over, end = os.pipe()
            self._held.callback(os.close, over)
            reader = threading.Thread(target=self._run, args=(over,), daemon=True, name="keyboard")
            self._held.callback(reader.join)
            self._held.callback(os.close, end)
            reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._held.close()

    @property
    def typed(self) -> str:
        """The text that was typed and not taken yet."""
        return self._typed

    def listen(self, listener: Callable[[], object] | None) -> Callable[[], object] | None:
        """Call a listener, in the event loop, while there is text to take. Return the one before it."""
        before, self._listener = self._listener, listener
        if self._typed or self.closed:
            self._loop.call_soon(self._call_listener)
        return before

    def take(self) -> str:
        """Take the next characters, at most up to the end of a line."""
        piece = self._typed[:MOST_KEYS_AT_ONCE]
        ends = [at + 1 for end in "\r\n" if (at := piece.find(end)) >= 0]
        piece = piece[: min(ends, default=MOST_KEYS_AT_ONCE)]
        self._typed = self._typed[len(piece) :]
        if self._typed:
            self._loop.call_soon(self._call_listener)
        return piece

    def forget(self) -> None:
        """Drop the text that was typed."""
        self._typed = ""

    def pick(self, start: int, end: int) -> str:
        """Take characters out of the middle of the text."""
        picked, self._typed = self._typed[start:end], self._typed[:start] + self._typed[end:]
        return picked

    def _call_listener(self) -> None:
        if self._listener is not None and (self._typed or self.closed):
            self._listener()

    def _came(self, data: bytes) -> None:
        """Take bytes of a console, in its reading thread."""
        if STOP_KEY in data:
            with isolated("the stop key"):  # the loop stops all the same
                self.stop_ahead()
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._read, data)

    def _run(self, over: int) -> None:
        """Read until the end, or until the terminal is gone. In a thread: the loop cannot delay it."""
        while over not in select.select([self.descriptor, over], [], [])[0]:
            try:
                data = os.read(self.descriptor, READ_BYTES)
            except OSError:
                data = b""  # EIO: the terminal is gone
            if STOP_KEY in data:
                with isolated("the stop key"):  # the loop stops all the same, and later keys are read
                    self.stop_ahead()
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._read, data)
            if not data:
                return

    def _read(self, data: bytes) -> None:
        if not data:
            self.closed = True
            self.gone()
        early, self._early = data[: self._early], max(0, self._early - len(data))
        data = early.replace(b"\0", END_OF_INPUT) + data[len(early) :]
        before, stopped, behind = data.rpartition(STOP_KEY)
        if stopped:
            dropped, self._typed = self._typed + self._decoder.decode(before), ""
            self._decoder.reset()
            self.stop(dropped.replace(STOP, ""))
        self._typed += self._decoder.decode(behind)
        self._call_listener()


def terminal() -> int | None:
    """The descriptor of standard input if that is a terminal, or a console of Windows; else None."""
    try:
        descriptor = sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):
        return None
    if sys.platform == "win32":
        return descriptor if is_console(descriptor) else None
    return descriptor if os.isatty(descriptor) else None


def foreground_terminal() -> int | None:
    """The same where this process is in the foreground of the terminal; else None."""
    descriptor = terminal()
    if sys.platform == "win32":
        return descriptor
    else:
        return descriptor if descriptor is not None and in_foreground(descriptor) else None


@contextlib.contextmanager
def on_signals(callback: Callable[[], None]) -> Iterator[None]:
    """Call back, in the event loop, for every signal that would end the process.

    A terminal that hangs up may send its signal twice. The second one must not cut off the end of the process.
    """
    loop = asyncio.get_running_loop()
    handled: list[Callable[[], object]] = []
    came: set[int] = set()

    def call(number: int) -> None:
        came.add(number)
        callback()

    with early_ends():
        for each in SIGNALS:
            with contextlib.suppress(NotImplementedError):  # a loop without signals: KeyboardInterrupt ends it
                handled.append(on_signal(loop, each, partial(call, each)))
        try:
            yield
        finally:
            for undo in handled:
                undo()
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
