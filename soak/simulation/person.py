"""A person at the prompt: bytes of a terminal in random groupings, through the product's keyboard and queue of lines.

The keyboard is the product's, without the thread that reads: each read of that thread is one call here. A read that
holds the stop key calls `stop_ahead` at once, wherever the loop is; what the loop does with the bytes follows later.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from contextvars import Context
from dataclasses import dataclass
from random import Random

from multidrop.shell.events import StateChanged
from multidrop.shell.prompt.keyboard import STOP_KEY, Keyboard
from multidrop.shell.prompt.line_queue import History, LineQueue
from multidrop.shell.prompt.terminal_input import at_keyboard
from multidrop.shell.session import Session
from soak.simulation.records.places import Place
from soak.simulation.system.clock import SimulatedLoop
from soak.simulation.system.cut_ins import LATEST, Aim, CutIns
from soak.simulation.system.process import Process

PASTE = ("\x1b[200~", "\x1b[201~")
"""What a terminal puts around a text that is pasted."""


class Person:
    """Types at the session of a process. `typed` is called with each read, before anything takes it."""

    def __init__(
        self,
        session: Session,
        loop: SimulatedLoop,
        rng: Random,
        typed: Callable[[bytes], None],
        cut_ins: CutIns,
        process: Process | None = None,
    ) -> None:
        self.keyboard = Keyboard(-1, signals=False)
        self.keyboard.stop_ahead, self.keyboard.stop = session.stop_ahead, self._stop
        self._cut_ins = cut_ins
        self.lines, self.history = LineQueue(session), History(session.settings.history)
        self._process = process
        self._session, self._loop, self._rng, self._typed = session, loop, rng, typed
        self._coming: deque[bytes] = deque()
        """Pieces on their way."""
        self._reading = False
        """The keyboard's thread writes a stop: it reads no further piece before it has passed this one on."""
        self._line = ""
        self._at = 0.0
        session.front.ask = lambda question: at_keyboard(self.keyboard, question)
        session.front.before_quit = self._may_quit
        self.quits: Callable[[], None] = lambda: None
        """Called once the session ends by a quit."""
        self.keyboard.listen(self._listen)
        self._stops = session.stops
        session.subscribe(self._noticed)
        self._sequence, self._pasting = "", False
        self.working = loop.create_task(self.lines.run())

    def _context(self) -> Context | None:
        return self._process.context.copy() if self._process is not None else None

    def type(self, data: bytes, spread: float = 0.0) -> None:
        """Let bytes arrive: in reads of any size, within `spread` seconds, in their order."""
        at = max(self._at, self._loop.now)
        while data:
            size = len(data) if not spread else self._rng.randrange(1, len(data) + 1)
            piece, data = data[:size], data[size:]
            at += 1e-6 + self._rng.random() * spread  # timers of one moment have no order
            self._coming.append(piece)
            self._loop.call_at(at, self._arrives, context=self._context())
        self._at = at

    def type_stop(self, aim: Aim) -> None:
        """Type a stop that cuts in at an aim, or comes at a turn of the loop once that was not passed for some time."""

        def arrive() -> None:
            if not self._reading and any(STOP_KEY in each for each in self._coming):
                piece = b""
                while STOP_KEY not in piece:
                    piece += self._coming.popleft()
                self.read(piece)

        self._coming.append(STOP_KEY)
        self._at = max(self._at, self._loop.now) + LATEST
        self._loop.call_at(self._at, self._arrives, context=self._context())
        process = self._process
        self._cut_ins.begin(aim, arrive if process is None else lambda: process.run(arrive))

    def _arrives(self) -> None:
        self._cut_ins.hurry()  # the thread that reads the keys
        if self._coming and not self.keyboard.closed:
            self.read(self._coming.popleft())

    def read(self, data: bytes, held: float = 0.0) -> None:
        """One read of the keyboard's thread, which is then held up for so long, s, before it passes the bytes on."""
        self._typed(data)
        if STOP_KEY in data:
            self._reading = True
            try:
                self.keyboard.stop_ahead()
            finally:
                self._reading = False
        if held:
            self._at = max(self._at, self._loop.now + held)
            self._loop.call_at(self._at, self.keyboard._read, data)
        else:
            self._loop.call_soon(self.keyboard._read, data)

    def paste(self, text: str, enter: bool = True) -> None:
        """Paste text in brackets, and type Enter behind it."""
        self.type(PASTE[0].encode() + text.encode() + PASTE[1].encode() + b"\r" * enter)

    def hang_up(self, gone: Callable[[], None]) -> None:
        """The terminal goes away; `gone` is called once the loop sees that."""
        self.keyboard.gone = gone
        self._coming.clear()
        self._loop.call_soon(self.keyboard._read, b"", context=self._context())

    async def leave(self) -> None:
        """Type nothing more."""
        self.lines.close()
        self.working.cancel()
        await asyncio.gather(self.working, return_exceptions=True)

    def _listen(self) -> None:
        for char in self.keyboard.take():
            if self._sequence or char == "\x1b":
                self._sequence += char
                if any(each.startswith(self._sequence) for each in PASTE):
                    if self._sequence in PASTE:
                        self._pasting, self._sequence = self._sequence == PASTE[0], ""
                    continue
                self._sequence = ""
            if self._pasting:
                self._line += char
            elif char in "\r\n":
                line, self._line = self._line, ""
                self.history.append(line)
                self.lines.enter(line)
            elif char == "\x03":
                self._interrupt()
            elif char == "\x7f":
                self._line = self._line[:-1]
            elif char.isprintable():
                self._line += char

    def _interrupt(self) -> None:
        """Ctrl+C: stop while anything runs, else clear the line, as the prompt does."""
        if self._session.busy:
            self._stop("", "Ctrl+C")
        self._line = ""

    def _stop(self, dropped: str, why: str = "Ctrl+X") -> None:
        lines, self._line = (self._line + dropped).splitlines(), ""
        self._sequence, self._pasting = "", False
        self._session.stop(why, follows=why == "Ctrl+X")
        self.lines.show_unsent("a stop came", lines)

    async def _may_quit(self) -> bool:
        """Decide a quit as the prompt does; the person does not ask twice."""
        with self.lines.deciding():
            return not await self._session.in_motion()

    def _noticed(self, event: object) -> None:
        if isinstance(event, StateChanged) and self._session.quitting:
            self.quits()
        if isinstance(event, StateChanged) and self._stops != self._session.stops:
            self._stops = self._session.stops
            self.lines.stopped()


@dataclass
class Other:
    """Another person, with a session of their own on a line that is shared. `stops`: how many they have typed."""

    place: Place
    session: Session
    person: Person
    opening: asyncio.Task[None]
    stops: int = 0

    async def leave(self) -> None:
        """Close the session."""
        await asyncio.wait([self.opening])
        await self.person.leave()
        await self.session.close()
