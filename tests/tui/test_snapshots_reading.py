"""Pictures of what reads back: search, filter, pause, lines picked to be copied, bytes, names of a drive."""

from collections.abc import Callable, Sequence

import pytest
from textual.pilot import Pilot

from multidrop.shell.events import Bytes, Printed
from multidrop.shell.prompt.complete import Completion
from multidrop.shell.transcripts import Filter
from tests.support.fake_session import (
    FakeAssist,
    FakeSession,
    a_move,
    a_talk,
    demo_session,
    make_app,
    settle,
)

pytestmark = pytest.mark.tui

Compare = Callable[..., bool]
SIZES = {"80x24": (80, 24), "120x40": (120, 40)}


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)


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
    "paused": (a_flood, ("ctrl+s", "pageup")),
    "bytes": (the_bytes, ()),
}


@pytest.mark.parametrize(
    ("name", "size"),
    [("find", "80x24"), ("find", "120x40"), ("pick", "80x24"), ("errors", "120x40"), ("paused", "80x24")]
    + [("bytes", "80x24")],
)
def test_snapshot_of_reading_back(snap_compare: Compare, name: str, size: str) -> None:
    session = demo_session()
    app = make_app(session)
    prepare, keys = SCREENS[name]

    async def act(pilot: Pilot[int]) -> None:
        await pilot.pause()
        for panel in app.main.panels.panels(app.main.wide):
            app.main.toggle_panel(panel.name)  # they have pictures of their own
        session.emit(*a_talk(session), *a_move(session))
        await settle(pilot)
        if prepare is not None:
            prepare(session)
        await settle(pilot)
        await pilot.press(*keys)
        await settle(pilot)

    assert snap_compare(app, terminal_size=SIZES[size], run_before=act)


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
    app = make_app(session)

    async def act(pilot: Pilot[int]) -> None:
        await pilot.pause()
        session.emit(*a_talk(session), *a_move(session))
        app.main.entry._complete = Named().complete
        app.assist = app.typist._assist = Named()
        await settle(pilot)
        await pilot.press(*"PR ", "tab")
        await settle(pilot)

    assert snap_compare(app, terminal_size=SIZES["80x24"], run_before=act)
