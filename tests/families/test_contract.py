"""Every family of the wheel is in the suite of `multidrop.contract`, and a family that breaks a promise fails it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from multidrop.contract.desk import Desk
from multidrop.dialects.codec import End
from multidrop.dialects.families import dialects
from multidrop.dialects.family import Family
from tests.families.minimal import test_contract
from tests.support import knock
from tests.support.paths import ROOT


def test_every_family_has_a_sample() -> None:
    files = (ROOT / "tests" / "families").rglob("test_contract.py")
    sampled = {name for file in files for name in re.findall(r'family="(\w+)"', file.read_text(encoding="utf-8"))}
    assert {*dialects()} <= sampled


def twice(self: Any, text: str, priority: Any = None) -> Any:
    reply = yield self.codec.request(self.state.address, text)
    if reply.end is End.TIMEOUT:
        reply = yield self.codec.request(self.state.address, text)
    return reply.lines


def printed(self: Any, text: str, priority: Any = None) -> Any:
    return (yield self.codec.request(self.state.address, text)).lines


def deaf(self: Any, data: bytes, now: float) -> None:
    receive(self, data.replace(b"*", b""), now)


receive = knock.KnockDrive.receive
BROKEN: list[tuple[type, str, Any, str]] = [
    (knock.KnockDrive, "receive", deaf, "the_stop_reaches_each_drive_and_is_confirmed"),
    (knock.Knock, "stop", lambda *given, **named: b"HALT\r", "the_stop_goes_first_and_what_was_queued_is_never_sent"),
    (knock.Knock, "hears_stop", lambda *given: False, "the_bytes_of_a_stop_are_heard_by_every_drive"),
    (knock.Knock, "starts_motion", lambda self, text: False, "an_automation_that_ends_early_stops_what_it_moved"),
    (knock.KnockFamily, "perform", twice, "a_move_whose_reply_is_lost_is_sent_once_and_its_fate_is_reported"),
    (knock.KnockFamily, "perform", printed, "a_refusal_is_a_failure_in_one_line_and_changes_nothing"),
    (knock.KnockFamily, "busy", Family.homed, "what_it_has_no_programs_for_is_one_line_and_sends_nothing"),
]


@pytest.mark.parametrize(("of", "name", "broken", "test"), BROKEN, ids=[test for *_, test in BROKEN])
def test_a_family_that_breaks_a_promise_fails(
    of: type, name: str, broken: Any, test: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    test_contract.listed(monkeypatch)
    suite = test_contract.TestKnock()
    getattr(suite, f"test_{test}")(Desk(suite.sample, tmp_path / "whole", monkeypatch))
    monkeypatch.setattr(of, name, broken)
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        getattr(suite, f"test_{test}")(Desk(suite.sample, tmp_path / "broken", monkeypatch))
