"""What the server of a port tells a person and a program of its clients, and which events it says once."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable

import pytest

from multidrop.features.sharing.server import REFUSAL_PERIOD, Narrator
from multidrop.features.sharing.writer_turns import Say

Shown = Callable[..., bool]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def shown(clock: list[float], capsys: pytest.CaptureFixture[str]) -> Shown:
    """Whether an event at a time is said."""
    narrator = Narrator(False)

    def at(time: float, client: str, event: str) -> bool:
        clock[0] = time
        narrator.say(Say(client, event))
        out, err = capsys.readouterr()
        assert out == ""
        return bool(err)

    return at


def test_a_client_that_is_refused_again_and_again_is_said_once_in_ten_seconds(shown: Shown) -> None:
    assert shown(100.0, "10.0.0.5:1000", "refused")
    assert not shown(101.0, "10.0.0.5:1001", "refused")
    assert not shown(100.0 + REFUSAL_PERIOD - 0.1, "10.0.0.5:1002", "refused")
    assert shown(100.0 + REFUSAL_PERIOD, "10.0.0.5:1003", "refused")
    assert not shown(100.0 + REFUSAL_PERIOD + 0.1, "10.0.0.5:1004", "connected")


@pytest.mark.parametrize("event", ["connected", "left", "refused", "lost"])
def test_of_a_host_that_was_sent_away_coming_and_going_is_not_said(shown: Shown, event: str) -> None:
    assert shown(100.0, "10.0.0.5:1000", event)
    assert shown(101.0, "10.0.0.6:1000", "lost")
    assert not shown(102.0, "10.0.0.6:1001", event)
    assert shown(103.0, "10.0.0.7:1001", event)
    assert shown(104.0, "10.0.0.6:1001", "writes")


def test_each_host_has_its_own_ten_seconds(shown: Shown) -> None:
    assert shown(100.0, "a:1", "refused") and shown(105.0, "b:1", "refused")
    assert shown(110.0, "a:2", "refused") and not shown(114.9, "b:2", "refused")
    assert not shown(119.9, "a:3", "lost") and shown(120.0, "a:4", "lost")


def test_what_has_no_host_is_always_said(shown: Shown) -> None:
    assert shown(100.0, "", "lost") and shown(100.0, "", "lost") and shown(100.0, "", "connected")


def test_for_a_person_it_is_a_line_with_its_time_on_standard_error(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    narrator = Narrator(False)
    narrator.say(Say("10.0.0.5:1000", "writes", "after 10 s"))
    narrator.say(Say("", "is back"))
    narrator.note("it is served")
    narrator.ready("press", "tcp://127.0.0.1:4000")
    out, err = capsys.readouterr()
    assert re.sub(r"\d\d:\d\d:\d\d", "TIME", err).splitlines() == [
        "TIME 10.0.0.5:1000 writes: after 10 s",
        "TIME the port is back",
        "multidrop: it is served",
    ]
    assert out.splitlines() == [
        "press        tcp://127.0.0.1:4000",
        "ready: Ctrl+X stops the drives, Ctrl+C ends it",
    ]


def test_for_a_program_every_event_is_an_object(
    clock: list[float], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time, "time", lambda: 5.12345)
    narrator = Narrator(True)
    narrator.ready("press", "tcp://127.0.0.1:4000")
    for _ in range(2):
        narrator.say(Say("10.0.0.5:1000", "refused", "it is taken"))
    out, err = capsys.readouterr()
    said = {"at": 5.123, "client": "10.0.0.5:1000", "event": "refused", "detail": "it is taken"}
    first = {"bus": "press", "endpoint": "tcp://127.0.0.1:4000"}
    assert [json.loads(line) for line in out.splitlines()] == [first, {"ready": True}, said, said]
    assert err == ""
