"""Rows of panels as text, and what a panel is drawn from, for tests without an app."""

from __future__ import annotations

from functools import partial

from multidrop.shell.events import SessionEvent
from multidrop.tui.app import bindings
from multidrop.tui.keymap import Keymap, keymap
from multidrop.tui.panels.view import View, figures_at, glances_of
from multidrop.tui.screen_model import ScreenModel
from multidrop.tui.widgets.lines import Row
from tests.support.fake_session import FakeSession


def plain(*rows: Row) -> str:
    return "\n".join("".join(text for text, _ in row) for row in rows)


def own_keys() -> Keymap:
    """The keys of the screen, none of which a person has changed."""
    return keymap(bindings(), {})


def view(session: FakeSession, *events: SessionEvent, polling: bool = True) -> View:
    """What the selected bus shows after these events."""
    model = ScreenModel(lambda: session.selected_bus, lambda: session.buses, partial(figures_at, session))
    for event in events:
        model.take(event)
    glances = glances_of(session, model, session.buses[session.selected_bus])
    return View(session, model, glances, session.now(), polling)
