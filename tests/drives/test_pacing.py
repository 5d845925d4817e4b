"""The thread that calls what must not wait for the event loop."""

from __future__ import annotations

import threading

import pytest

from multidrop.drives.pacing import Pacer
from tests.support.until import PATIENCE


def test_a_defect_in_the_work_of_one_owner_keeps_no_other_one_from_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    raised = list[BaseException | None]()
    monkeypatch.setattr(threading, "excepthook", lambda each: raised.append(each.exc_value))
    pacer, done, later = Pacer(), threading.Event(), threading.Event()

    def broken() -> None:
        pacer.after("waiting", 0.0, done.set)
        raise ZeroDivisionError("planted")

    pacer.after("broken", 0.0, broken)
    assert done.wait(PATIENCE)
    pacer.after("later", 0.0, later.set)
    assert later.wait(PATIENCE) and [type(each) for each in raised] == [ZeroDivisionError]


def test_what_an_owner_asks_for_is_in_place_of_what_it_has_asked_for_before() -> None:
    """A key in the pause before the repetition of a stop: the next piece is due at once, not after the pause."""
    pacer, done = Pacer(), threading.Event()
    never = list[str]()
    pacer.after("a line", 60.0, lambda: never.append("late"))
    pacer.after("another", 60.0, lambda: never.append("late"))
    pacer.after("a line", 0.0, done.set)
    assert done.wait(PATIENCE) and never == []
