"""The page of a plant: every drive of every publisher at a broker, the worst first; it reads, and reaches no drive.

It is an app of its own, without a session: nothing here could send a line. What is typed narrows the list.
"""

from __future__ import annotations

import asyncio
import sys
from collections import Counter
from collections.abc import Mapping
from datetime import datetime, timedelta
from importlib.resources import files
from typing import ClassVar

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType

from multidrop import tui
from multidrop.features.publishing.broker import load, parse_target
from multidrop.features.publishing.plant import ENDED, ERROR, UNKNOWN, URGENCY, PlantRow, TopicPlace, shown
from multidrop.features.publishing.registry import AT_REST, MOVING
from multidrop.features.publishing.watch import DRAIN, PlantWatch, begun, summary
from multidrop.shell import configuration
from multidrop.shell.configuration import Settings
from multidrop.shell.events import FAILURES
from multidrop.shell.exit_codes import exit_code
from multidrop.shell.prompt.keyboard import on_signals
from multidrop.shell.streams.stdout import report, write
from multidrop.tui.boundary import Boundary
from multidrop.tui.text import age, fit
from multidrop.tui.widgets.bars import Banner
from multidrop.tui.widgets.lines import Lines, Roles, in_view, spread
from multidrop.tui.widgets.lines import Row as Shown
from multidrop.tui.widgets.theme import Dressed

PAINT = 0.5
"""Seconds between two pictures while nothing is pressed."""
CALM = (UNKNOWN, ENDED, MOVING, AT_REST)
WHERE, NAME, STATE, NUMBER, AGE = 16, 16, 10, 14, 7
UNREACHED = "‼ NOT REACHED: Ctrl+X at {}, or the emergency stop there; this page only reads"
PARTS = ("heading", "columns", "drives", "ignored", "footer")
KEYS = (("↑↓", "choose"), ("Enter", "follow"), ("Esc", "back"), ("type", "narrows"), ("^Q", "quit"))


class PlantApp(Dressed):
    """The screen of a plant."""

    CSS_PATH = str(files(tui) / "multidrop.tcss")
    CSS = "#drives { height: 1fr; }"
    TITLE = "multidrop plant"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+x", "unreached", priority=True),
        Binding("ctrl+q", "quit", priority=True),
        Binding("ctrl+c", "nothing", priority=True),
        Binding("escape", "back"),
        Binding("enter", "follow"),
        Binding("backspace", "shorten"),
        *(Binding(key, f"step({by})") for key, by in (("up", -1), ("down", 1), ("pageup", -10), ("pagedown", 10))),
        *(Binding(key, f"step({by})") for key, by in (("home", -(10**9)), ("end", 10**9))),
    ]

    broker: PlantWatch

    def __init__(self, url: str, settings: Settings) -> None:
        super().__init__(settings.screen)
        self.target, self._settings = parse_target(url, "plant"), settings
        self._rows: list[PlantRow] = []
        self._chosen: TopicPlace | None = None
        self._words = self._told = ""
        self._is_composed = False
        self.boundary = Boundary(settings.state, self.tell, "everything else goes on")
        self.boundary.own(self, lambda: self._is_composed)
        self.dress(settings.screen)

    def compose(self) -> ComposeResult:
        yield Roles()
        heading, *others = (Lines(id=part) for part in PARTS)
        yield heading
        yield Banner()
        yield from others

    async def watch_broker(self, over: asyncio.Event) -> bool:
        """Connect; return whether that was done before `over`. Raises TransportLost or Diagnostic."""
        self.broker = PlantWatch(self.target, self._settings, self.tell)
        return await begun(self.broker, over)

    async def end(self) -> None:
        await self.broker.end()

    def on_mount(self) -> None:
        self._is_composed, self._end_boundary = True, self.boundary.look_at(asyncio.get_running_loop())
        self.set_interval(DRAIN, self.broker.drain)
        self.set_interval(PAINT, self.paint)
        self.call_after_refresh(self.paint)

    def on_unmount(self) -> None:
        self._end_boundary()

    def tell(self, text: str) -> None:
        self._told = text

    # Keys

    def action_unreached(self) -> None:
        """Say that no drive was reached, and where to go."""
        self.query_one(Banner).show(((f" {UNREACHED.format(self._elsewhere())}", "stop"),))

    def _elsewhere(self) -> str:
        row = self._row()
        if row is None or row.place.publisher not in self.broker.plant.publishers:
            return "the PC of the drive"
        host = self.broker.plant.publishers[row.place.publisher].host
        return f"{host} ({row.where})" if host and host != row.where else host or f"the PC of {row.place.publisher}"

    def action_nothing(self) -> None:
        self._told = "^Q quits"
        self.paint()

    async def action_quit(self) -> None:
        self.exit(0)

    async def action_back(self) -> None:
        """Close the banner, the followed drive, or the words, one at a time."""
        banner, plant, self._told = self.query_one(Banner), self.broker.plant, ""
        if banner.display:
            banner.show(())
        elif plant.followed is not None:
            plant.follow(None)
        else:
            self._words = ""
        self.paint()

    def action_follow(self) -> None:
        if (row := self._row()) is not None and row.place.line:
            self.broker.plant.follow(row.place)
            self.paint()

    def action_shorten(self) -> None:
        self._words = self._words[:-1]
        self.paint()

    def action_step(self, by: int) -> None:
        if self._rows:
            at = min(max(self._at() + by, 0), len(self._rows) - 1)
            self._chosen = self._rows[at].place
            self.paint()

    def on_key(self, event: events.Key) -> None:
        if event.is_printable and event.character and self.broker.plant.followed is None:
            self._words += event.character
            self._chosen = None
            self.paint()

    def on_click(self, event: events.Click) -> None:
        rows = self.query_one("#drives", Lines)
        if event.widget is rows and self.broker.plant.followed is None:
            visible = in_view(self._rows, self._at(), rows.size.height)
            if event.y < len(visible):
                self._chosen = visible[event.y][1].place
                self.paint()

    # Pictures

    def _at(self) -> int:
        places = [row.place for row in self._rows]
        return places.index(self._chosen) if self._chosen in places else 0

    def _row(self) -> PlantRow | None:
        return self._rows[self._at()] if self._rows else None

    def paint(self) -> None:
        parts = {part.id: part for part in self.query(Lines)}
        if not parts.keys() >= set(PARTS):
            return  # a timer of an app whose screen is being taken down
        with self.boundary.at("the page of the plant") as attempt:
            self._paint(parts)
        if attempt.trouble:  # what is shown may no longer be true
            for part in parts.values():
                part.put([])
            parts["heading"].put([((f" {attempt.trouble}", "error"),)])

    def _paint(self, parts: Mapping[str | None, Lines]) -> None:
        plant, everything = self.broker.plant, self.broker.rows()
        wanted = self._words.casefold().split()
        self._rows = [row for row in everything if all(word in _text(row) for word in wanted)]
        if plant.followed is not None and plant.followed not in plant.drives:
            self.tell("the followed drive is published no more")
            plant.follow(None)
        width = self.size.width
        counts = Counter(URGENCY[row.urgency[0]] for row in everything)
        states = " · ".join(f"{counts[state]} {state}" for state in URGENCY if counts[state])
        broker = [("BROKER LOST ", "error")] if self.broker.lost else [(f"{self.target.text} ", "dim")]
        left = [(" PLANT   ", "strong"), (states or "nothing is published here yet", "text")]
        parts["heading"].put([spread(left, broker, width)])
        below = " · ".join(filter(None, (self._told, summary(plant, everything))))
        parts["ignored"].put([((fit(f" {below}", width), "strong" if self._told else "dim"),)])
        footer: Shown = tuple(span for key, word in KEYS for span in ((f" {key}", "key"), (f" {word} ", "dim")))
        words = [(f"{self._words}▏ ", "strong")] if self._words else []
        parts["footer"].put([spread([*footer, ("  read only", "dim")], words, width)])
        body = parts["drives"]
        if plant.followed is not None:
            head, rows = self._drive(plant.followed)
        else:
            head = _columns(width)
            at = self._at()
            rows = [_drive_row(row, width, here == at) for here, row in in_view(self._rows, at, body.size.height)]
        parts["columns"].put([head])
        body.put(rows[: body.size.height])

    def _drive(self, place: TopicPlace) -> tuple[Shown, list[Shown]]:
        """The values of the followed drive with their ages, and its samples, the newest first."""
        now, plant = self.broker.now, self.broker.plant
        row = next((each for each in self.broker.rows() if each.place == place), None)
        assert row is not None
        head: Shown = (
            (f" {row.where}  {':'.join(filter(None, (row.line, row.drive)))}  ", "strong"),
            (row.state, _role(row)),
            (f"   at {self._elsewhere()}", "dim"),
        )
        rows: list[Shown] = []
        for (what, axis), reading in plant.drives[place].items():
            text = f"{shown(reading)} {'' if what in ('position', 'velocity') else reading.text}".rstrip()
            rows.append(
                ((f"  {fit(f'{axis} {what}'.strip(), NAME)} ", "dim"), (fit(text, 40), "text"), _age(now, reading.at))
            )
        rows.append((("  samples, the newest first", "dim"),))
        for sample in reversed(plant.samples):
            time = (datetime.now() - timedelta(seconds=now - sample.at)).strftime("%H:%M:%S.%f")[:-5]
            rows.append(
                (
                    (f"  {time}  {fit(f'{sample.axis} {sample.what}'.strip(), NAME)} ", "dim"),
                    (shown(sample.reading), "text"),
                )
            )
        return head, rows


def _text(row: PlantRow) -> str:
    return f"{row.where} {row.line}:{row.drive} {row.state} {row.error}".casefold()


def _role(row: PlantRow) -> str:
    if row.error or row.state not in CALM:
        return "error"
    return "motion" if row.state == MOVING else "dim" if row.state in (UNKNOWN, ENDED) else "text"


def _age(now: float, at: float | None) -> tuple[str, str]:
    return ("  age unknown", "dim") if at is None else (f"  {age(now - at)} ago", "text")


def _columns(width: int) -> Shown:
    names = (
        f" {fit('place', WHERE)} {fit('line:drive', NAME)} {fit('state', STATE)}{'position':>{NUMBER}}{'age':>{AGE}}"
    )
    return ((fit(f"{names}  {'velocity, error' if width >= 100 else 'error'}", width), "dim"),)


def _drive_row(row: PlantRow, width: int, chosen: bool) -> Shown:
    name = ":".join(filter(None, (row.line, row.drive))) if row.place.line else "no drive"
    old = "dim" if row.age is None else "text"
    error = row.error or (row.numbers["velocity"] if width >= 100 else "")
    return (
        ("▸" if chosen else " ", "accent"),
        (fit(row.where, WHERE) + " ", "accent" if chosen else "text"),
        (fit(name, NAME) + " ", "accent" if chosen else "text"),
        (fit(row.state, STATE), _role(row)),
        (f"{fit(row.numbers['position'], NUMBER - 1).strip():>{NUMBER}}", old),
        (f"{'?' if row.age is None else age(row.age):>{AGE}}", old),
        (fit(f"  {error}", width), ERROR if row.error else "dim"),
    )


def run(url: str) -> int:
    """Show the plant at a URL; return the exit code."""
    try:
        settings = configuration.load(lenient=True)
        load("plant")
        return asyncio.run(_run(PlantApp(url, settings)))
    except FAILURES as failure:
        write(sys.stderr, report(failure))
        return exit_code(failure)


async def _run(app: PlantApp) -> int:
    over = asyncio.Event()

    def end() -> None:
        over.set()
        app.exit(0)

    with on_signals(end):
        try:
            if await app.watch_broker(over):
                await app.run_async()
        finally:
            await app.end()
    return 0 if over.is_set() else 1 if app.return_value is None else app.return_value
