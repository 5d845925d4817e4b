"""What an automation's line has started, by what became of the line: a refused or unsent one has started nothing."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from multidrop.base.errors import Differs, Inexpressible, NoAnswer, Refused, Stopped, TransportLost
from multidrop.drives.drive import Drive
from multidrop.shell.sending import sending
from multidrop.shell.session import Session
from tests.support.automated import automated
from tests.support.cell_session import bus, party, pmx, session_on

pytestmark = pytest.mark.virtual


def lost(*, unproven: str = "", executed: str = "") -> TransportLost:
    made = TransportLost("press was lost")
    made.unproven, made.executed = unproven, executed
    return made


@pytest.fixture
async def session(tmp_path: Path) -> AsyncIterator[Session]:
    async with session_on(tmp_path, bus("press", party("a")) + bus("stages", pmx("00"), pmx("01"))) as made:
        yield made


def started(session: Session) -> set[str]:
    automation = session.origin.automation
    assert automation is not None
    return {each.address for each in automation.started}


REFUSAL, DOUBT, SILENCE = Refused("a refused it"), Refused("or another line", certain=False), NoAnswer("no reply")


@pytest.mark.parametrize(
    ("failure", "sent", "parts", "counts"),
    [
        (REFUSAL, True, False, False),
        (Inexpressible("too long"), True, False, False),
        (Differs("another value"), True, False, False),
        (DOUBT, True, False, True),
        (SILENCE, True, False, True),
        (Stopped("stopped"), True, False, True),
        (REFUSAL, True, True, True),
        (lost(), True, False, True),
        (lost(unproven="MR 5"), False, False, True),
        (lost(executed="MR 5"), False, False, True),
        *((each, False, parts, False) for each in (REFUSAL, DOUBT, SILENCE, Stopped("x"), lost()) for parts in (0, 1)),
    ],
    ids=lambda value: f"{type(value).__name__} {value}" if isinstance(value, Exception) else str(value),
)
async def test_a_line_that_failed_counts_if_it_may_have_been_executed(
    session: Session, failure: Exception, sent: bool, parts: bool, counts: bool
) -> None:
    drive = session.drive("press", "a")
    async with automated(session):
        with pytest.raises(type(failure)):
            async with sending(session.automations, session.origin, drive, "MR 5", starts=True, parts=parts):
                assert started(session) == {"a"}
                drive.commands += sent
                raise failure
        assert started(session) == ({"a"} if counts else set())
        session.automations.leave(session.origin)


async def test_a_refused_line_leaves_what_was_started_before_it(session: Session) -> None:
    drive, automations = session.drive("press", "a"), session.automations
    async with automated(session):
        async with sending(automations, session.origin, drive, "MR 5", starts=True):
            pass
        assert session.origin.automation is not None
        before = session.origin.automation.started[drive]
        with pytest.raises(Refused):
            async with sending(automations, session.origin, drive, "EX G9", starts=True):
                assert session.origin.automation.started[drive].what.program
                raise REFUSAL
        assert session.origin.automation.started == {drive: before} and not before.what.program
        automations.leave(session.origin)


async def test_an_unsent_line_to_all_leaves_what_another_line_has_commanded_meanwhile(session: Session) -> None:
    every, other = session.drive("stages", "*"), session.drive("stages", "01")
    async with automated(session):
        with pytest.raises(NoAnswer):
            async with sending(session.automations, session.origin, every, "X5", starts=True):
                assert started(session) == {"00", "01"}
                other.commanded_at = session.now()
                raise SILENCE
        assert started(session) == {"01"}
        session.automations.leave(session.origin)


async def test_a_line_that_was_executed_as_program_mode_had_ended_counts(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive, stores = session.drive("press", "a"), [True]
    monkeypatch.setattr(Drive, "stores", property(lambda each: stores[0]))
    async with automated(session):
        for line, counted in (("PR P", set()), ("MR 5", {"a"})):
            stores[0] = True
            with pytest.raises(Refused):
                async with sending(session.automations, session.origin, drive, line, starts=False):
                    stores[0] = False
                    raise DOUBT
            assert started(session) == counted
        session.automations.leave(session.origin)


@pytest.mark.parametrize(
    ("failure", "parts", "commanded"), [(REFUSAL, False, False), (REFUSAL, True, True), (DOUBT, False, True)]
)
async def test_after_a_stop_a_drive_that_refused_a_line_is_not_taken_for_started(
    session: Session, failure: Exception, parts: bool, commanded: bool
) -> None:
    drive, halt = session.drive("press", "a"), session.buses["press"].stop()
    with pytest.raises(Refused):
        async with session.path.starting(session.origin, drive, "MR 5", parts=parts):
            assert halt.started_since(drive)
            raise failure
    assert halt.started_since(drive) is commanded
