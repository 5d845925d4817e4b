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
