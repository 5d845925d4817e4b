"""`multidrop plant` without a screen, and the connection that keeps a plant up to date, which publishes nothing."""

from __future__ import annotations

import asyncio
import json
import sys
from collections import deque
from collections.abc import Callable
from datetime import datetime

from multidrop.base.text import counted
from multidrop.features.publishing.broker import BrokerConnection, Target, fresh_name, load, parse_target
from multidrop.features.publishing.plant import LONGEST_PAYLOAD, LONGEST_TOPIC, Plant, PlantRow
from multidrop.features.publishing.publisher import again, connected, over
from multidrop.shell import configuration
from multidrop.shell.configuration import Settings
from multidrop.shell.events import FAILURES
from multidrop.shell.exit_codes import exit_code
from multidrop.shell.prompt.keyboard import on_signals
from multidrop.shell.streams.stdout import fail, finish, nonblocking, write
from multidrop.transports import Unreachable

INBOX = 5000
"""Messages that wait for `drain`; beyond, the oldest are dropped and counted."""
DRAIN = 0.1
"""Seconds between two calls of `drain`: one turn of the event loop takes many messages."""
BUSY = 0.1
"""The longest time of one `drain`, s: keys and signals come between two."""
PRINT = 1.0
"""Seconds between two looks for rows that have changed."""


class PlantWatch:
    """A plant, and its broker, which is tried again when it is lost. `begin`, then `drain` every DRAIN seconds."""

    def __init__(self, target: Target, settings: Settings, notify: Callable[[str], None]) -> None:
        """`notify` takes what happens to the broker."""
        self._loop = asyncio.get_running_loop()
        self.plant, self.target = Plant(target.prefix, self._loop.time()), target
        self.lost = False
        self.left = ""
        """Why the broker was left for good; empty: it was not."""
        self._notify = notify
        self._make = lambda: BrokerConnection(target, settings.section("mqtt"), None, fresh_name(), self._take)
        self._waiting: deque[tuple[str, bytes, bool, float]] = deque(maxlen=INBOX)
        self._dropped = 0
        self._task: asyncio.Task[None] | None = None

    async def begin(self) -> None:
        """Connect for the first time. Raises TransportLost or Diagnostic."""
        self._task = self._loop.create_task(self._keep(await connected(self._make)))

    async def end(self) -> None:
        if self._task is not None:
            await over(self._task)

    def _take(self, topic: str, payload: bytes, retained: bool) -> None:
        """Queue a message, in the thread of the connection."""
        self._dropped += len(self._waiting) == INBOX
        self._waiting.append((topic[: LONGEST_TOPIC + 1], payload[: LONGEST_PAYLOAD + 1], retained, self.now))

    @property
    def now(self) -> float:
        return self._loop.time()

    def drain(self) -> None:
        """Work off messages that wait, for a limited time."""
        end = self.now + BUSY
        while self._waiting and self.now < end:
            self.plant.take(*self._waiting.popleft())
        if self._dropped:
            self.plant.ignored["dropped: they came too fast"] += self._dropped
            self._dropped = 0

    def rows(self) -> list[PlantRow]:
        return self.plant.rows(self.now)

    async def _keep(self, connection: BrokerConnection) -> None:
        try:
            while True:
                await connection.lost.wait()
                self.lost = True
                self.plant.lost(self.now)
                if connection.refused:
                    self.left = f"{connection.refused}; it is left, and every age is unknown now"
                    self._notify(self.left)
                    return
                self._notify("the broker is lost: the age of every value is unknown; it is tried again")
                await connection.close()
                connection = await again(self._make, self._notify)
                self.lost = False
                self._notify("the broker is back")
        finally:
            await connection.close()


def summary(plant: Plant, rows: list[PlantRow]) -> str:
    """`50 PCs, 1 without about · 500 drives`, and the messages that were not read."""
    bare = sum(not publisher.host for publisher in plant.publishers.values())
    parts = [counted(len(plant.publishers), "PC") + (f", {bare} without about" if bare else "")]
    parts += [counted(sum(bool(row.place.line) for row in rows), "drive")]
    return " · ".join([*parts, *(f"{counted(number, 'message')} {why}" for why, number in plant.ignored.items())])


def run(url: str, *, as_json: bool) -> int:
    """Print a line for each drive, and again when it has changed, until a signal; return the exit code."""
    return asyncio.run(_run(url, as_json))


async def _run(url: str, as_json: bool) -> int:
    over = asyncio.Event()
    with nonblocking() as streams, on_signals(over.set):
        try:
            target = parse_target(url, "plant")
            load("plant")
            watch = PlantWatch(target, configuration.load(), lambda text: write(sys.stderr, text))
            try:
                if await begun(watch, over):
                    await _print(watch, as_json, over)
            finally:
                await watch.end()
            return exit_code(Unreachable(watch.left)) if watch.left else 0
        except FAILURES as failure:
            return fail(failure)
        finally:
            await finish(streams, over.is_set)


async def begun(watch: PlantWatch, over: asyncio.Event) -> bool:
    """Connect; return whether that was done before a signal. Raises TransportLost or Diagnostic."""
    begin, signal = asyncio.create_task(watch.begin()), asyncio.create_task(over.wait())
    await asyncio.wait((begin, signal), return_when=asyncio.FIRST_COMPLETED)
    signal.cancel()
    if not begin.done():
        begin.cancel()
        return False
    await begin
    return True


async def _print(watch: PlantWatch, as_json: bool, over: asyncio.Event) -> None:
    """Print rows as they change, until a signal, or until the broker is left."""
    loop, shown, said = asyncio.get_running_loop(), dict[object, PlantRow](), ""
    due = loop.time() + PRINT
    while not (over.is_set() or watch.left):
        await asyncio.sleep(DRAIN)
        watch.drain()
        if loop.time() < due:
            continue
        due = loop.time() + PRINT
        rows = watch.rows()
        for row in rows:
            before = shown.get(row.place)
            if before is None or row._replace(age=None) != before._replace(age=None):
                write(sys.stdout, _object(watch.plant, row) if as_json else _line(row))
        shown = {row.place: row for row in rows}
        if (text := summary(watch.plant, rows)) != said:
            said = text
            write(sys.stderr, text)


def _line(row: PlantRow) -> str:
    time = datetime.now().strftime("%H:%M:%S")
    name = ":".join(filter(None, (row.line, row.drive)))
    return f"{time}  {row.where}  {name or '(no drive)'}  {row.state}  {row.numbers['position']}  {row.error}".rstrip()


def _object(plant: Plant, row: PlantRow) -> str:
    """A row as an object for programs, with the age of each value; null: unknown."""
    now, publisher = asyncio.get_running_loop().time(), plant.publishers[row.place.publisher]
    values: list[dict[str, object]] = [
        {"what": what, "axis": axis, "value": value.value, "text": value.text}
        | {"age": None if value.at is None else round(now - value.at, 1)}
        for (what, axis), value in plant.drives.get(row.place, {}).items()
    ]
    message = {"time": datetime.now().astimezone().isoformat(timespec="milliseconds"), "place": row.where}
    more = {
        "publisher": row.place.publisher,
        "host": publisher.host,
        "program": plant.program(row.place.publisher, now),
    }
    return json.dumps(message | more | {"line": row.line, "drive": row.drive, "state": row.state, "values": values})
