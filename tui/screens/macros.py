"""The page of macros: names, keys, values and notes; which one plays and its step; play, record, edit, put on a key."""

from __future__ import annotations

import asyncio
import shlex
from collections.abc import Sequence
from typing import NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, MacroStore
from multidrop.shell.playing import Playing
from multidrop.tui.panels.view import View
from multidrop.tui.screens.dialogs import Ask, Confirm
from multidrop.tui.screens.page import ListPage, PageHost, start
from multidrop.tui.screens.program_rows import news_rows, rule
from multidrop.tui.text import fit, visible
from multidrop.tui.widgets.lines import Row, in_view, spread

NAME, KEY = 20, 8
NEWS = 3
"""Lines of the transcript below the macros."""
NOTHING: tuple[Row, ...] = (
    ((" no macro yet", "dim"),),
    ((" ^P, record a macro: what you type is kept, with the pauses between the lines", "dim"),),
)

_NONE: tuple[Row, ...] = (((" no macro has that", "dim"),),)


class ListedMacro(NamedTuple):
    """A macro in the list; without a `macro`, why its file cannot be read."""

    name: str
    macro: Macro | None = None
    trouble: str = ""

    @property
    def place(self) -> str:
        """Its key with the page: `F3`, `F3.2`."""
        if self.macro is None or not self.macro.key:
            return "-"
        return self.macro.key if self.macro.page == "1" else f"{self.macro.key}.{self.macro.page}"

    @property
    def words(self) -> str:
        """What narrows the list."""
        return f"{self.name} {self.place} {self.macro.note if self.macro is not None else ''}".casefold()


def listed(store: MacroStore) -> list[ListedMacro]:
    """Every macro. For a thread."""
    try:
        return [_listed(store, name) for name in store.names()]
    except Diagnostic as problem:
        return [ListedMacro("", None, str(problem))]


def _listed(store: MacroStore, name: str) -> ListedMacro:
    try:
        macro = store.load(name)
        macro.values  # noqa: B018  # a value that is declared wrong is a trouble of the file
        return ListedMacro(name, macro)
    except Diagnostic as problem:
        return ListedMacro(name, None, str(problem))


def macro_row(each: ListedMacro, playing: Playing | None, width: int, chosen: bool) -> Row:
    """Name, key, step where it plays, length and values, note."""
    head: Row = (
        ("▸" if chosen else " ", "accent"),
        (fit(visible(each.name), NAME) + " ", "accent" if chosen else "text"),
        (fit(each.place, KEY), "strong"),
    )
    room = width - NAME - KEY - 2
    if each.macro is None:
        return (*head, (fit(f"✗ {visible(each.trouble)}", room), "error"))
    if playing is not None:
        return (*head, (fit(f"▶ plays, step {playing.step} of {playing.steps}", room), "motion"))
    about = "   ".join(filter(None, (each.macro.length, each.macro.values, visible(each.macro.note))))
    return (*head, (fit(about, room), "dim"))


def step_rows(each: ListedMacro, playing: Playing | None, width: int, height: int) -> list[Row]:
    """The lines of a macro around the one that plays."""
    if each.macro is None or height < 1:
        return []
    lines = each.macro.lines
    current = playing.step - 1 if playing is not None and playing.step else None
    return [
        (
            (" ▶ " if number == current else "   ", "motion"),
            (f"{number + 1:>3}  ", "dim"),
            (fit(visible(line), width - 8), "motion" if number == current else "text"),
        )
        for number, line in in_view(lines, current or 0, height)
    ]


ENTER = "enter"


class MacrosPage(ListPage):
    """The macros. Enter plays the chosen one that is shown, or the one whose whole name was typed."""

    SHEET = "macros"
    FIELD, LIST = "filter", "macros"
    WANTS = frozenset({"motion"})
    PARTS = {"heading": None, "filter": None, "macros": "1fr", "steps": None, "news": NEWS + 1}

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._macros: list[ListedMacro] = []
        self._shown: list[ListedMacro] = []
        """Those that have what was typed."""
        self._at = 0
        self._painted = False
        """The rows were shown as they are."""
        self._read_for: object = None
        """The facts of the app at the last reading: it makes new ones whenever a macro may have changed."""
        self._reading = self._known = False
        """Reading goes on; they were read once."""

    def show(self, view: View) -> None:
        """Paint the list around the chosen macro, and its lines."""
        if self.host.macros.names is not self._read_for and not self._reading:
            self._reading, self._read_for = True, self.host.macros.names
            self.run_worker(self._read())
        width, height = self.size.width, max(2, self.size.height - NEWS - 6)
        playing = {each.name: each for each in view.session.playing}
        self.edited(self.words)
        chosen = self._chosen()
        room = min(max(len(self._shown), 2), height // 2)
        below = self.put_rows(
            self._shown,
            self._at,
            lambda each, is_chosen: macro_row(each, playing.get(each.name), width, is_chosen),
            (NOTHING if not self._macros else _NONE) if self._known else [],
            room,
        )
        recording = f"● recording {view.session.recording}: /record stop ends it " if view.session.recording else ""
        heading: Row = ((" MACROS   ", "strong"), (f"{len(self._shown)} of {len(self._macros)}", "text"))
        self.lines("heading").put(
            [spread(heading, [below, (recording or "Enter plays ", "motion" if recording else "dim")], width)]
        )
        self._painted = self.host.keyboard.idle
        rows: list[Row] = []
        if chosen is not None:
            rows.append(rule(visible(chosen.name), width))
            rows += step_rows(chosen, playing.get(chosen.name), width, height - room - 1)
        self.lines("steps").styles.height = max(1, height - room)
        self.lines("steps").put(rows)
        records = news_rows(self.host.last_records(NEWS), view.session.wall, width)
        self.lines("news").put([rule("transcript", width), *records])

    async def _read(self) -> None:
        try:
            name = chosen.name if (chosen := self._chosen()) is not None else ""
            self._macros = await asyncio.to_thread(listed, self.host.session.macros)
            self._known = True
            self.edited(self.words)
            names = [macro.name for macro in self._shown]
            self._at = names.index(name) if name in names else self._at
        finally:
            self._reading = False

    def _chosen(self) -> ListedMacro | None:
        return self._shown[self._at] if self._at < len(self._shown) else None

    # Keys

    def edited(self, text: str) -> None:
        """Keep the macros that have every typed word in name, key or note; one with just that name is chosen."""
        words, before = text.casefold().split(), self._shown
        self._shown = [macro for macro in self._macros if all(word in macro.words for word in words)]
        if self._shown != before:
            self._painted = False
            named = [n for n, macro in enumerate(self._shown) if macro.name == text]
            self._at = named[0] if named else 0 if words else self._at
        self._at = min(self._at, max(0, len(self._shown) - 1))

    def choose(self, at: int) -> None:
        self._at = at

    async def action_clicked(self, at: int) -> None:
        """Choose a row. A click plays nothing."""
        self.choose(at)

    def action_step(self, by: int) -> None:
        self._at = min(max(self._at + by, 0), max(0, len(self._shown) - 1))

    def typed(self, text: str) -> None:
        """Play the chosen macro, if it was shown; an Enter that was typed ahead plays only a whole name."""
        if self._is_meant(text):
            self.action_play()

    def _is_meant(self, text: str) -> bool:
        """Return whether the chosen macro was shown, or its whole name was typed."""
        chosen = self._chosen()
        return chosen is not None and (self._painted or chosen.name == text)

    def _type(self, *words: str) -> None:
        self.host.outbox.type(" ".join(words))

    def action_play(self) -> None:
        """Play the chosen macro, once a press; it asks for the values that it needs.

        The line waits for no other one: presses while the macro plays are refused, and play nothing later. A macro
        that has changed on the disk is not played: it is shown as it is now.
        """
        chosen = self._chosen()
        if chosen is None or self.host.macros.held(ENTER, self.host.session.now()):
            return
        if chosen.macro is not None:
            start(self, f"/play {chosen.name}", chosen.macro)
        else:
            self.host.show_line(f"{chosen.trouble}; nothing was played", "x")
        self.host.model.changed = True  # it is read again: its file may have changed

    async def action_times(self) -> None:
        """Ask how often to play the chosen macro, and play the one that was chosen then. A stop closes the question."""
        chosen, stops = self._chosen(), self.host.session.stops
        if chosen is None or chosen.macro is None or not self._is_meant(self.words):
            return
        macro = chosen.macro

        def answered(times: str | None) -> None:
            if times:
                start(self, f"/play {macro.name} --times {shlex.quote(times)}", macro, stops)
                self.host.model.changed = True

        about = "a number, or forever: until it is stopped"
        await self.app.push_screen(Ask(f"Play {macro.name} how many times?", about=about), answered)

    def action_end(self) -> None:
        if (chosen := self._chosen()) is not None:
            self.host.outbox.at_once([f"/play stop {chosen.name}"])

    async def action_edit(self) -> None:
        chosen = self._chosen()
        if chosen is None or not chosen.name:
            return
        try:
            path = self.host.session.macros.path(chosen.name)
            await asyncio.to_thread(self.host.texts.open, str(path))
        except Diagnostic as problem:
            self.host.show_line(str(problem), "x")
            return
        await self.app.run_action("act.page('program')")

    async def action_key(self) -> None:
        chosen = self._chosen()
        if chosen is None:
            return

        def named(text: str | None) -> None:
            key, _, page = (text or "").strip().upper().partition(".")
            if key:
                self._type("/key", key, chosen.name, *(["--page", page] if page else []))

        about = "F2 to F12, or F3.2 for a page of keys"
        await self.app.push_screen(Ask(f"Key of {chosen.name}", chosen.place.strip("-"), about), named)

    async def action_delete(self) -> None:
        chosen = self._chosen()
        if chosen is None or not chosen.name:
            return

        def answered(answer: str | None) -> None:
            if answer == "delete":
                self._type("/macro delete", chosen.name)

        answers: Sequence[tuple[str, str]] = [("no", "Keep it"), ("delete", f"Delete it   /macro delete {chosen.name}")]
        await self.app.push_screen(Confirm(f"Delete the macro {chosen.name}?", [], answers), answered)
