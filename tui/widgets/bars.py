"""The lines around the screen: the top line with its tabs, the red line under it, the footer with the keys.

Tabs give way in steps: the words of the states, the ends of the names, the names, then runs of neighbours without
trouble fold into one (`4-12 ■`). The selected tab and those in trouble stay; trouble that finds no room is counted
(`✗9`). In the footer the stop always comes first; the rest gives way from the right.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass

from textual import events

from multidrop.shell.stop_report import FateTally, headline, words
from multidrop.tui.keymap import read_key
from multidrop.tui.readout import ReadoutState
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Lines, Row, Span, width_of

TRYING = "; trying again"
"""The end of a reason for a loss while the bus is being tried again."""


def banner_row(tally: FateTally | None, lost: str, width: int) -> Row:
    """The text of the banner; an empty row if there is none. It is red until every drive was read at rest.

    `tally` is what is known since a latched stop, `lost` the reason of a lost bus. A tally of drives that stood before
    their bus was lost is not shown in place of the loss.
    """
    if tally is not None and not (lost and tally.stand):
        return ((fit(f" {headline(tally, width - 1)}", width), "latched" if tally.sure else "stop"),)
    if not lost:
        return ()
    before = f"; before that {words(tally)}" if tally is not None else ""
    text, advice = f" ✗ LOST - {lost.removesuffix(TRYING)}", TRYING if lost.endswith(TRYING) else ""
    room = width - len(advice)  # a reason of any length gives way to what is done
    text = f"{text if len(text) <= room else fit(text, room)}{advice}"
    return ((text + fit(before, width - len(text)), "stop"),)


class Banner(Lines):
    """One line, on a ground of its own, that takes no room while it is empty."""

    def __init__(self) -> None:
        super().__init__(classes="banner")

    def show(self, row: Row) -> None:
        """Show a row; hide for an empty one."""
        self.display = bool(row)
        self.put([row])


STOP = "^X STOP ALL"


def footer_row(
    keys: Sequence[tuple[str, str]], recording: bool, latched: bool, width: int, progress: str = "", help_: str = ""
) -> Row:
    """Return the stop and the keys that work here, (key, word), in `width` cells.

    A function without a key is left out. Keys that do not fit are left out, the last ones first. `progress`: the words
    on the job that runs, after the stop. `help_`: the key of the help, which is always there; its word is if it fits.
    """
    keys = [(key, word[:14]) for key, word in keys if key]
    if recording:
        keys.insert(0, ("/record stop", "ends it"))
    if latched:
        keys.insert(0, ("/resume", "run again"))
    row: list[Span] = [*STOP_ROW]
    if progress:
        row.append((f" {fit(progress, max(0, width - width_of(row) - 2)).rstrip()} ", "strong"))
    last = help_ if all(key != help_ for key, _ in keys) else ""
    room = width - 1 - (len(last) + 2 if last else 0)
    for key, what in keys:
        span: list[Span] = [("  ", "text"), (key, "key"), (f" {what}", "dim")]
        if width_of(row) + width_of(span) > room:
            break
        row += span
    if last and room >= width_of(row):
        row += [("  ", "text"), (last, "key")]
        row += [(" help", "dim")] if width_of(row) + len(" help") < width else []
    return tuple(row)


STOP_ROW: Row = ((" ", "text"), (f" {STOP} ", "stop"), (" ", "text"))


class StopSign(Lines):
    """The stop alone, for screens that lie over a footer and dim it."""

    def on_mount(self) -> None:
        self.put([STOP_ROW])


def key_at(row: Row, x: int) -> str:
    """The key at a column of the footer, or the one whose word is there; empty beside them."""
    shown, end = "", 0
    for text, role in row:
        end += width_of([(text, role)])
        shown = text.strip() if role == "key" else shown if role == "dim" else ""
        if x < end:
            return shown
    return ""


MOVING = frozenset({"act.play", "play", "jog", "step", "enter", "submit"})
"""Actions that may move a drive, or send what is pending: they need their key. A click may only focus the terminal."""


class Footer(Lines):
    """The footer. A click on a key does what the key does, unless that moves; the app handles the one on the stop."""

    @staticmethod
    def is_stop(x: int) -> bool:
        return 0 < x <= len(STOP) + 2

    async def on_click(self, event: events.Click) -> None:
        """Do what the key under the pointer does, or begin the line that stands there."""
        shown = key_at(self.rows[0], event.x) if self.rows else ""
        if shown.startswith("/") and len(shown) > 1:
            await self.run_action(f"act.begin_line({shown!r})")
        elif bound := self.screen.active_bindings.get(read_key(shown)):
            if bound.binding.action.partition("(")[0] in MOVING:
                self.notify(f"Nothing was sent: a click moves nothing; press {shown}", timeout=4)
                return
            await self.app.run_action(bound.binding.action, bound.node)


NAME = " multidrop  "
TROUBLE = frozenset({ReadoutState.LOST, ReadoutState.SILENT, ReadoutState.TROUBLE, ReadoutState.DIFFERS})
STATE_WORD = 7
"""Width of the word of a state in a tab; `no current` alone is longer."""
LONGEST_TAB_NAME = 24
"""Greatest width of a name in a tab."""
SHORT = 10
"""The same beside a tab with words."""
SHORTEST_TAB_NAME = 3
"""The same where there is no room for more."""


@dataclass(frozen=True)
class Tab:
    """A bus as its tab shows it."""

    number: int
    name: str
    state: ReadoutState
    selected: bool
    old: bool = False
    """The state may be outdated."""
    mark: str = ""
    """Trouble besides the state: `?` a drive is silent, `!` an error or a limit, `≠` a drive differs from its twin."""

    @property
    def in_trouble(self) -> bool:
        return self.state in TROUBLE or bool(self.mark)

    @property
    def role(self) -> str:
        return "dim" if self.old and self.state is not ReadoutState.LOST else self.state.role


def tab_spans(tab: Tab) -> list[Span]:
    """Format ` 1 press ▶ moving `, in a width that does not change with the state."""
    blank = " " * (STATE_WORD - len(tab.state.word))
    spans = _spans(tab, f" {tab.number} {_cut(tab.name, LONGEST_TAB_NAME)} ", f"{tab.state.sign} {tab.state.word}", " ")
    return [*spans, (blank, spans[0][1])] if blank else spans


def _named(tab: Tab, name: str = "") -> list[Span]:
    """` 1 press ▶ `."""
    return _spans(tab, f" {tab.number} {name or _cut(tab.name, SHORT)} ", tab.state.sign)


def _tight(tab: Tab, name: str) -> list[Span]:
    """` 1 press▶`; the selected tab keeps its name."""
    return _named(tab) if tab.selected else _spans(tab, f" {tab.number} {name}", tab.state.sign, end="")


def _small(tab: Tab) -> list[Span]:
    """` 1■`; the selected tab keeps its name."""
    return _named(tab) if tab.selected else _spans(tab, f" {tab.number}", tab.state.sign, end="")


def _cuts(tabs: Sequence[Tab], width: int) -> list[str]:
    """The names in `width` cells at most. Those that begin alike keep their ends, which tell them apart."""
    begun = Counter(_cut(tab.name, width) for tab in tabs)
    return [
        f"…{tab.name[1 - width :]}"
        if len(tab.name) > width and begun[_cut(tab.name, width)] > 1
        else _cut(tab.name, width)
        for tab in tabs
    ]


def _longest(tabs: Sequence[Tab], shown: Callable[[Tab, str], list[Span]], least: int, room: int) -> list[Span]:
    """The tabs with names as long as they all fit; an empty list where names of the `least` width do not."""
    for width in range(LONGEST_TAB_NAME, least - 1, -1):
        spans = [span for tab, name in zip(tabs, _cuts(tabs, width), strict=True) for span in shown(tab, name)]
        if width_of(spans) <= room:
            return spans
    return []


def _cut(name: str, width: int) -> str:
    return name if len(name) <= width else fit(name, width)


def _spans(tab: Tab, body: str, state: str, end: str = " ") -> list[Span]:
    """Number and name, state, and the mark of other trouble, which is red; `end` where there is no mark."""
    plain, role, trouble = ("focus", "focus", "stop") if tab.selected else ("text", tab.role, "error")
    if tab.selected and tab.state in TROUBLE:
        role = "stop"
    marked: list[Span] = [(state, role), (tab.mark, trouble)] if tab.mark else [(state + end, role)]
    return [(body, plain), *marked]


def _each(tabs: Sequence[Tab], shown: Callable[[Tab], list[Span]]) -> list[Span]:
    return [span for tab in tabs for span in shown(tab)]


def _folded(tabs: Sequence[Tab], alike: Callable[[Tab, Tab], bool]) -> list[Span]:
    """Small tabs, with runs of neighbours without trouble as one."""
    runs: list[list[Tab]] = []
    for tab in tabs:
        last = runs[-1][-1] if runs else None
        stays = tab.selected or tab.in_trouble
        if last is not None and not stays and not (last.selected or last.in_trouble) and alike(last, tab):
            runs[-1].append(tab)
        else:
            runs.append([tab])
    return [span for run in runs for span in (_run(run) if len(run) > 2 else _each(run, _small))]


def _run(run: Sequence[Tab]) -> list[Span]:
    """` 4-12 ■`, with the sign of the one that moves if any does, or else of one that runs a program."""
    shown = next(
        (tab for state in (ReadoutState.MOVING, ReadoutState.DWELL) for tab in run if tab.state is state), run[0]
    )
    return [(f" {run[0].number}-{run[-1].number} ", "text"), (shown.state.sign, shown.role)]


def _counted(tabs: Sequence[Tab], room: int) -> list[Span]:
    """The selected tab, as much trouble around it as fits, and the number of what else is in trouble."""
    at = next((n for n, tab in enumerate(tabs) if tab.selected), 0)
    shown = [tab for tab in tabs if tab.selected]
    for tab in sorted(
        (tab for tab in tabs if tab.in_trouble and not tab.selected), key=lambda tab: abs(tab.number - at)
    ):
        more = sorted([*shown, tab], key=lambda each: each.number)
        if width_of(_each(more, _small)) + len(f" ✗{len(tabs)}") > room:
            break
        shown = more
    hidden = sum(tab.in_trouble for tab in tabs if tab not in shown)
    count: list[Span] = [(f" ✗{hidden}", "error")] if hidden else []
    rest = len(tabs) - len(shown) - hidden
    spans = [*_each(shown, _small), *count]
    if rest and width_of(spans) + len(f" +{rest}") <= room:
        spans.append((f" +{rest}", "dim"))
    return spans


def tabs_row(tabs: Sequence[Tab], room: int) -> list[Span]:
    """The tabs in `room` cells at most, as large as they fit."""
    forms: tuple[Callable[[], list[Span]], ...] = (
        lambda: _each(tabs, tab_spans),
        lambda: _longest(tabs, lambda tab, name: tab_spans(tab) if tab.selected else _named(tab, name), SHORT, room),
        lambda: _longest(tabs, _named, SHORT, room),
        lambda: _longest(tabs, _tight, SHORTEST_TAB_NAME, room),
        lambda: _each(tabs, _small),
        lambda: _folded(tabs, lambda one, other: one.state is other.state),
        lambda: _folded(tabs, lambda one, other: True),
    )
    for form in forms:
        spans = form()
        if spans and width_of(spans) <= room:
            return spans
    return _counted(tabs, room)


def top_row(
    tabs: Sequence[Tab],
    recording: str,
    clock: str,
    width: int,
    log: bool = False,
    playing: str = "",
    notes: Sequence[str] = (),
) -> Row:
    """The whole line: tabs at the left; the macro that plays, recording, notes, log and clock at the right."""
    right: list[Span] = []
    if playing:
        right.append((f" ▶ {fit(playing, 20).rstrip()} ", "motion"))
    if recording:
        right.append((f" ● rec {recording[:16]} ", "error"))
    right += ((f" {note} ", "accent") for note in notes)
    if log:
        right.append((" ● log ", "text"))
    right.append((f" {clock} ", "dim"))
    room = width - width_of(right)
    left: list[Span] = []
    if width >= 100 and width_of(_each(tabs, tab_spans)) + len(NAME) <= room:
        left.append((NAME, "strong"))
    left += tabs_row(tabs, room - width_of(left))
    gap = max(0, room - width_of(left))
    return (*left, (" " * gap, "text"), *right)


def rule_row(width: int, junctions: Container[int], sign: str) -> Row:
    """A rule, with a junction (`┬`, `┴`) at some columns."""
    return (("".join(sign if x in junctions else "─" for x in range(width)), "rule"),)


def tab_at(row: Row, x: int) -> int | None:
    """The number of the tab at a column; of a folded run its first."""
    number, end = None, 0
    for text, _ in row:
        end += width_of([(text, "")])
        if match := re.match(r"\s*(\d+)(?:[\s-]|$)", text):
            number = int(match[1])
        elif not text.strip() or re.fullmatch(r" [✗+]\d+", text):
            number = None
        if x < end:
            return number
    return None


class TopLine(Lines):
    """The top line. A click on a tab shows its bus."""

    async def on_click(self, event: events.Click) -> None:
        number = tab_at(self.rows[0], event.x) if self.rows else None
        if number is not None:
            await self.run_action(f"act.bus_number({number})")
