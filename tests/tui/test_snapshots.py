"""The screens as pictures. `make snapshots` renews them; look at them before you commit."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import math
import re
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path

import pytest
from textual.pilot import Pilot

from multidrop.base.errors import TransportLost
from multidrop.dialects.by_hand import Variable
from multidrop.dialects.values import IO, VARIABLES, Conditions, Reading, Readings
from multidrop.drives.events import Conditioned, Sample, Traffic, Valued
from multidrop.drives.stopping import Fate
from multidrop.shell.batch.virtual_loop import VirtualLoop
from multidrop.shell.events import Bytes, OnBus, Phase, Printed, ProgramRead, ProgramSeen, SettingsRead, VariablesRead
from multidrop.shell.prompt.complete import Completion
from multidrop.shell.roles import Filter, Series
from multidrop.tui.app import MultidropApp
from multidrop.tui.curves.samples import TraceQuantity
from multidrop.tui.curves.trigger import TriggerSetting
from multidrop.tui.screens.program import ProgramPage
from multidrop.tui.widgets.theme import Signs
from tests.support.fake_session import (
    FakeAssist,
    FakeBus,
    FakeDrive,
    FakeSession,
    a_move,
    a_talk,
    demo_session,
    emit,
    make_app,
    press,
    settle,
)
from tests.support.fake_twin import a_stall
from tests.support.until import PATIENCE

pytestmark = pytest.mark.tui

Compare = Callable[..., bool]
Act = Callable[[Pilot[int], FakeSession], Awaitable[None]]
SIZES = {"80x24": (80, 24), "120x40": (120, 40), "200x50": (200, 50)}
BOTH = ("80x24", "120x40")


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)


def drawn(
    compare: Compare, size: str, act: Act, theme: str = "multidrop-dark", session: FakeSession | None = None
) -> bool:
    """Compare the screen after an act on a session, that of the demo unless another is given."""
    session = session or demo_session()

    async def run(pilot: Pilot[int]) -> None:
        await pilot.pause()
        await act(pilot, session)
        await settle(pilot)

    app = make_app(session, theme=theme)
    with contextlib.closing(VirtualLoop()) as loop:
        app.run = functools.partial(app.run, loop=loop)  # type: ignore[method-assign]
        return compare(app, terminal_size=SIZES[size], run_before=run)


def after(*keys: str, later: float = 0.0) -> Act:
    """Talk with moving drives, press keys, and let some time pass."""

    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        if session.buses:
            session.emit(*a_talk(session), *a_move(session))
        await settle(pilot)
        await pilot.press(*keys)
        session.time += later

    return act


# The main screen, and what lies over it

KEYS = {
    "main": (),
    "plot": ("ctrl+g", "ctrl+g"),
    "stopped": ("ctrl+x",),
    "completing": ("M", "tab"),
    "selector": ("ctrl+o",),
    "help": ("f1",),
    "lost": ("alt+3",),
    "drives": ("ctrl+a",),
    "palette": ("ctrl+p",),
    "split": ("ctrl+p", *"split the", "enter", "down", "enter"),
}


@pytest.mark.parametrize("size", BOTH)
@pytest.mark.parametrize("name", KEYS)
def test_snapshot(snap_compare: Compare, size: str, name: str) -> None:
    assert drawn(snap_compare, size, after(*KEYS[name]))


@pytest.mark.parametrize("page", ["main", "drives"])
@pytest.mark.parametrize("size", BOTH)
def test_snapshot_of_a_stop_that_a_program_survives(snap_compare: Compare, size: str, page: str) -> None:
    """`a` runs its program on, `b` has ended its own, `c` was not read since: its row is dim and of the past."""
    fates = {"a": Fate.RUNNING, "b": Fate.STANDING, "c": Fate.NOT_KNOWN}
    runs = (Conditions(program="running", runs=True),)

    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        for name in fates:
            session.emit(OnBus("press", Sample(session.time - 0.2, name, 100, 0)))
            session.emit(OnBus("press", Conditioned(session.time - 1.0, name, runs)))
        await settle(pilot)
        await pilot.press("ctrl+x", *KEYS[page])
        session.time += 2.0
        session.fates = {f"press:{name}": fate for name, fate in fates.items()} | {"eth:": Fate.STANDING}
        for name in "ab":
            session.emit(OnBus("press", Sample(session.time - 0.1, name, 200, 0, program=name == "a")))

    assert drawn(snap_compare, size, act)


@pytest.mark.parametrize("keys", [(), ("ctrl+g", "ctrl+g"), ("ctrl+a",)], ids=["main", "plot", "drives"])
@pytest.mark.parametrize("size", BOTH)
def test_snapshot_in_units(snap_compare: Compare, size: str, keys: tuple[str, ...]) -> None:
    """`a` has a scale and a travel, `b` one that is not confirmed, `c` none."""
    session = demo_session()
    session.units.give("a", {"scale": "5 mm/turn", "zero": "-20 mm", "travel": "-50..600 mm"})
    session.units.give("b", "-360 deg/turn").sure = False
    assert drawn(snap_compare, size, after(*keys), session=session)


def test_snapshot_of_values_that_have_grown_old(snap_compare: Compare) -> None:
    assert drawn(snap_compare, "120x40", after(later=3.0))


@pytest.mark.parametrize("theme", ["multidrop-ansi", "multidrop-light"])
def test_snapshot_in_other_colours(snap_compare: Compare, theme: str) -> None:
    assert drawn(snap_compare, "80x24", after("ctrl+x", "M", "tab"), theme)


def test_snapshot_without_colours(snap_compare: Compare, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert drawn(snap_compare, "80x24", after("ctrl+x", "ctrl+o"), "")


def test_snapshot_of_the_first_screen(snap_compare: Compare) -> None:
    assert drawn(snap_compare, "80x24", after(), session=FakeSession())


def test_snapshot_of_the_start_page_where_there_is_room(snap_compare: Compare) -> None:
    assert drawn(snap_compare, "120x40", after(), session=FakeSession())


def test_no_picture_is_empty() -> None:
    """A picture that was taken before the first paint would show nothing for ever."""
    pictures = list(Path(__file__).with_name("__snapshots__").rglob("*.svg"))
    words = {
        each.name: len(re.findall(r"textLength=\"[\d.]+\"[^>]*>[^<]*\w", each.read_text("utf-8"))) for each in pictures
    }
    assert len(words) > 50 and [name for name, count in words.items() if count < 10] == []


def test_snapshot_of_the_tour(snap_compare: Compare) -> None:
    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        app = pilot.app
        assert isinstance(app, MultidropApp)
        app.tour.begin_on("press")
        await after()(pilot, session)

    assert drawn(snap_compare, "80x24", act)


def test_snapshot_of_many_lines_in_ascii(snap_compare: Compare) -> None:
    buses = [FakeBus(f"line{n}", {"a": FakeDrive("a")}) for n in range(1, 33)]
    buses[19].lost = TransportLost("unplugged")

    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        pilot.app.act.show_signs(Signs.ASCII)  # type: ignore[attr-defined]
        await after("ctrl+g", "ctrl+g")(pilot, session)

    assert drawn(snap_compare, "80x24", act, session=FakeSession(*buses))


# What reads back: search, filter, pause, lines picked to be copied, bytes, names of a drive


def only_errors(session: FakeSession) -> None:
    assert session.front.transcripts is not None
    session.front.transcripts.choose(Filter(errors=True))


def a_flood(session: FakeSession) -> None:
    session.emit(*(Printed(session.time, "press", "a", f"{n}") for n in range(60)))


def the_bytes(session: FakeSession) -> None:
    shown = ((True, "aPR P\\n                  61 50 52 20 50 0A"), (False, "\\x0651200\\r\\n           06 35 31"))
    session.emit(*(Bytes(session.time, "press", way, "", (row,), watched=True) for way, row in shown))
    assert session.front.transcripts is not None
    session.front.transcripts.set_times("last")


SCREENS: dict[str, tuple[Callable[[FakeSession], None] | None, Sequence[str]]] = {
    "find": (None, ("ctrl+f", *"pr")),
    "pick": (None, ("shift+up", "shift+up", "shift+up")),
    "errors": (only_errors, ()),
    "paused": (a_flood, ("ctrl+b", "pageup")),
    "bytes": (the_bytes, ()),
}


@pytest.mark.parametrize(
    ("name", "size"),
    [("find", "80x24"), ("find", "120x40"), ("pick", "80x24"), ("errors", "120x40"), ("paused", "80x24")]
    + [("bytes", "80x24")],
)
def test_snapshot_of_reading_back(snap_compare: Compare, name: str, size: str) -> None:
    prepare, keys = SCREENS[name]

    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        main = pilot.app.main  # type: ignore[attr-defined]
        for name in [place[0].name for _, places in main.columns() for place in places]:
            main.toggle_panel(name)  # they have pictures of their own
        await emit(pilot, *a_talk(session), *a_move(session))
        if prepare is not None:
            prepare(session)
        await settle(pilot)
        await pilot.press(*keys)

    assert drawn(snap_compare, size, act)


class Named(FakeAssist):
    """Knows the labels and variables of the drive."""

    def complete(self, text: str, learned: Callable[[], None] | None = None) -> Sequence[Completion]:
        """Offer them after PR."""
        names = {"Q1": "variable, 5 when it was read", "GO": "label at 100"}
        return [Completion(name, about, 3) for name, about in names.items()] if text == "PR " else []

    def hint(self, text: str) -> str:
        """The meaning of PR."""
        return 'PR <name>[, "<text>"]   print values or text; manual 5.1.104'


def test_snapshot_of_the_names_of_a_drive(snap_compare: Compare) -> None:
    session = demo_session()
    app = make_app(session, assist=Named())

    async def act(pilot: Pilot[int]) -> None:
        await pilot.pause()
        await emit(pilot, *a_talk(session), *a_move(session))
        await press(pilot, *"PR ", "tab")

    assert snap_compare(app, terminal_size=SIZES["80x24"], run_before=act)


# The page of plots, and a drive beside its twin

WAYS = {"several": (), "cursor": ("space", *["left"] * 12), "split": ("s", "minus", "minus")}
WAYS["two"] = (*WAYS["cursor"], "x", *["left"] * 20)


def several(session: FakeSession) -> None:
    """`a` accelerates, `b` swings and counts a switch, `c` rests."""
    session.plotted = (*(Series("press", each) for each in "abc"), Series("press", "b", "I1"))
    session.emit(*a_move(session)[:480])
    for n in range(300):
        at, turn = session.time - 12 + n / 25, n / 20
        position, velocity = int(2_000_000 * math.sin(turn)), int(250_000 * math.cos(turn))
        session.emit(OnBus("press", Sample(at, "b", position, velocity)), OnBus("press", Sample(at, "c", 51_300, 0)))
        session.emit(OnBus("press", Valued(at, "b", "I1", float(position > 0))))


def stalled(session: FakeSession) -> None:
    session.emit(*a_stall(session))


def plotted(prepare: Callable[[FakeSession], None], *keys: str, signs: Signs = Signs.FULL) -> Act:
    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        pilot.app.act.show_signs(signs)  # type: ignore[attr-defined]
        prepare(session)
        await settle(pilot)
        await pilot.press(*keys)

    return act


PLOTS = [("several", "80x24"), ("several", "120x40"), ("cursor", "80x24"), ("split", "120x40"), ("two", "120x40")]


@pytest.mark.parametrize(("way", "size"), PLOTS)
def test_plots(snap_compare: Compare, way: str, size: str) -> None:
    assert drawn(snap_compare, size, plotted(several, "ctrl+g", *WAYS[way]))


@pytest.mark.parametrize(("size", "keys"), [("80x24", ()), ("120x40", ()), ("120x40", ("ctrl+g",))])
def test_a_drive_that_stalls_beside_its_twin(snap_compare: Compare, size: str, keys: tuple[str, ...]) -> None:
    assert drawn(snap_compare, size, plotted(stalled, *keys))


@pytest.mark.parametrize(("size", "signs"), [("120x40", Signs.FULL), ("80x24", Signs.ASCII)])
def test_a_trigger_that_holds_the_picture(snap_compare: Compare, size: str, signs: Signs) -> None:
    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        await plotted(lambda _: None, "ctrl+g", signs=signs)(pilot, session)
        model = pilot.app.model  # type: ignore[attr-defined]
        setting = TriggerSetting(TraceQuantity("press", "a", "", "velocity"), 300_000, True, 0.25)
        model.look.arm(setting, True, model.traces)
        several(session)
        session.time += 20
        model.changed = True

    assert drawn(snap_compare, size, act, "multidrop-ansi" if signs is Signs.ASCII else "multidrop-dark")


def test_plots_in_ascii(snap_compare: Compare) -> None:
    assert drawn(snap_compare, "80x24", plotted(several, "ctrl+g", signs=Signs.ASCII), "multidrop-ansi")


def test_the_plot_of_a_twin_in_ascii(snap_compare: Compare) -> None:
    assert drawn(snap_compare, "80x24", plotted(stalled, "ctrl+g", signs=Signs.ASCII), "multidrop-ansi")


# Controls and parameters

PAGES = {
    "controls": ("ctrl+n", "up", "right", "right"),
    "parameters": ("d", "slash", *"e", "enter", "down", "enter"),
    "main": (),
}
FOUND = Readings(
    (
        Reading("A", 1_000_000, unit="steps/s²", default=1_000_000),
        Reading("EE", 0, default=0),
        Reading("HC", 15, unit="%", default=5),
        Reading("MS", 256, unit="microsteps", default=256),
        Reading("VM", 600_000, unit="steps/s", default=768_000),
        Reading("IS1", (1, 0), IO, default=(0, 0)),
        Reading("Q1", 7, VARIABLES),
    )
)


@pytest.mark.parametrize(
    ("name", "size"), [(name, size) for name in PAGES for size in SIZES if name != "main" or size == "200x50"]
)
def test_page(snap_compare: Compare, name: str, size: str) -> None:
    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        await emit(pilot, *a_talk(session), *a_move(session))
        if name == "parameters":
            session.emit(SettingsRead(session.time, "press", "a", FOUND))
            await pilot.app.run_action("act.page('parameters')")
            await settle(pilot)
        await pilot.press(*PAGES[name])

    assert drawn(snap_compare, size, act)


# Forms

FORMS = {
    "outputs": ("2",),
    "programs": ("down", "enter"),
    "setup": ("down", "enter", *"5 mm", "enter", "down", "enter", *"0 to 300", "enter", "ctrl+s"),
    "variables": ("r", "down", "enter", *"77", "enter"),
}
VARIABLES_OF_A = (*(Variable(f"R{n}", n * 100, "kept by S") for n in (1, 2, 3, 4)), Variable("Q1", 3, "kept by S"))


@pytest.mark.parametrize("size", BOTH)
@pytest.mark.parametrize("name", FORMS)
def test_form(snap_compare: Compare, name: str, size: str) -> None:
    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        await emit(pilot, *a_talk(session), *a_move(session))
        session.emit(VariablesRead(session.time, "press", "a", VARIABLES_OF_A))
        await pilot.app.run_action(f"act.page('{name}')")
        await settle(pilot)
        if name == "setup":
            await press(pilot, *["down"] * 7, "enter", *"press", "enter", *["up"] * 7)
        await press(pilot, *FORMS[name])

    assert drawn(snap_compare, size, act)


# Programs, macros and traffic

TEXT = """' Goes there and comes back.
VM=768000
PG 1
LB G1
  MA 512000        ' out
  H
  PR "out at ", P
  MA 0             ' back
  H
  BR G1
E
PG
"""
LINES = ["LB G1", "MA 512000 ' out", "H", 'PR "out at ",P', "MA 0 ' back", "H", "BR G1", "E"]
ROWS = tuple((1 + 6 * number, line) for number, line in enumerate(LINES))


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with a program, and with one that has errors."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("multidrop.tui.screens.program.CHECK_DELAY", 0.02)
    (tmp_path / "shuttle.mxt").write_text(TEXT)
    (tmp_path / "wrong.mxt").write_text(TEXT.replace("MA 0", "MAX 0").replace("PR", "PRINT"))


async def checked(pilot: Pilot[int], file: str) -> ProgramPage:
    """Open a file, and wait for its check."""
    app = pilot.app
    app.texts.open(file)  # type: ignore[attr-defined]
    await app.run_action("act.page('program')")
    async with asyncio.timeout(PATIENCE):
        while not isinstance(app.screen, ProgramPage) or app.screen.findings.pending:
            await pilot.pause(0.01)
            app.tick()  # type: ignore[attr-defined]
    return app.screen


async def with_errors(pilot: Pilot[int], session: FakeSession) -> None:
    await checked(pilot, "wrong.mxt")


async def traced(pilot: Pilot[int], session: FakeSession) -> None:
    page = await checked(pilot, "shuttle.mxt")
    session.emit(ProgramRead(session.time, "press", "a", ROWS))
    async with asyncio.timeout(PATIENCE):
        while not page.findings.addresses:
            await pilot.pause(0.01)
            pilot.app.tick()  # type: ignore[attr-defined]
    session.emit(ProgramSeen(session.time, "press", "a", 25, Phase.BEFORE, "G1"))


async def macros(pilot: Pilot[int], session: FakeSession) -> None:
    await pilot.app.run_action("act.page('macros')")
    for _ in range(3):
        await settle(pilot)


async def traffic(pilot: Pilot[int], session: FakeSession) -> None:
    for number, data in enumerate((b"aPR P\n", b"384112\r\n", b"aMR 512000\n", b"\x06", b"bPR VX\n", b"?\r\n")):
        session.emit(OnBus("press", Traffic(session.time + number / 10, number % 2 == 0, data)))
    await pilot.app.run_action("act.page('traffic')")


def beside_a_talk(show: Act) -> Act:
    async def act(pilot: Pilot[int], session: FakeSession) -> None:
        session.emit(*a_talk(session), *a_move(session))
        await show(pilot, session)

    return act


@pytest.mark.usefixtures("programs")
@pytest.mark.wide
@pytest.mark.parametrize("size", BOTH)
@pytest.mark.parametrize("act", [with_errors, traced, macros, traffic])
def test_snapshot_of_a_page(snap_compare: Compare, size: str, act: Act) -> None:
    assert drawn(snap_compare, size, beside_a_talk(act))


@pytest.mark.usefixtures("programs")
@pytest.mark.parametrize("theme", ["multidrop-ansi", "multidrop-light"])
def test_snapshot_of_a_program_in_other_colours(snap_compare: Compare, theme: str) -> None:
    assert drawn(snap_compare, "80x24", beside_a_talk(traced), theme)


@pytest.mark.usefixtures("programs")
def test_snapshot_of_a_program_without_colours(snap_compare: Compare, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert drawn(snap_compare, "80x24", beside_a_talk(traced), "")
