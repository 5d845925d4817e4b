"""What a line of an automation has started, by what became of the line.

It has started nothing if it was not sent, or if the drive has refused it, and no routine of the drive for errors began
because of that. Whatever else became of it, it may have been executed.
"""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from dataclasses import dataclass

from multidrop.base.errors import Differs, Inexpressible, NoAnswer, Refused, TransportLost
from multidrop.dialects import Started
from multidrop.drives.drive import Drive
from multidrop.drives.port_journal import GLOBAL
from multidrop.shell import at_rest
from multidrop.shell.automation import Automations
from multidrop.shell.automation_record import Automation, SentMotion
from multidrop.shell.events import FAILURES
from multidrop.shell.origin import Origin


@dataclass(frozen=True)
class _DriveBefore:
    """What was known of a drive before a line."""

    sent: SentMotion | None
    requests: int
    commands: int
    commanded_at: float
    active: bool


@contextlib.asynccontextmanager
async def sending(
    automations: Automations,
    origin: Origin,
    drive: Drive,
    text: str,
    *,
    starts: bool,
    only_ends: bool = False,
    parts: bool = False,
) -> AsyncIterator[None]:
    """Send a line in the body, and record what it can start; with an empty text anything.

    `parts`: it is several requests, of which a drive may have executed one before it refused another.

    Raises what the body raises, Diagnostic where the line must not start the drive, Stopped.
    """
    automation = origin.automation
    if automation is not None and not parts and _has_routine(drive) and drive not in automation.started:
        await at_rest.look_before(drive, text)
    what = drive.codec.started(text) if text else Started()
    stored, at = drive.stores, drive.link.stamp()
    before = {recipient: _before(automation, recipient) for recipient in drive.recipients}
    for other in before if starts else ():
        automations.starts(origin, other, what, only_ends=only_ends)
    try:
        yield
    except FAILURES as failure:
        if automation is None:
            raise
        if stored and not drive.stores and drive.starts(text):  # it was executed, as program mode had ended
            automations.records(automation, drive, what)
            raise
        for other, was in before.items():
            each_as_it_was = other is drive or other.commanded_at == was.commanded_at
            if each_as_it_was and _started_nothing(other, was, failure, parts):
                automations.restores(automation, other, was.sent)
            sure = other in automation.started or was.active or stored
            if not sure and _has_error(other, was, text, failure, at):
                await _after_error(automations, automation, other)
        raise


def _before(automation: Automation | None, drive: Drive) -> _DriveBefore:
    sent = automation.started.get(drive) if automation is not None else None
    return _DriveBefore(sent, drive.requests, _commands(drive), drive.commanded_at, bool(at_rest.known_active(drive)))


def _commands(drive: Drive) -> int:
    """The number of requests that may do more than ask; one to all drives has no reply, so each of those counts."""
    return drive.requests if drive.address in GLOBAL else drive.commands


def _has_routine(drive: Drive) -> bool:
    return drive.codec.error_routine and drive.address not in GLOBAL and not (drive.stores or drive.state.stranger)


def _started_nothing(drive: Drive, before: _DriveBefore, failure: BaseException, parts: bool) -> bool:
    """Whether a line that failed has started nothing by itself in a drive."""
    if isinstance(failure, TransportLost) and (failure.unproven or failure.executed):
        return False
    if _commands(drive) == before.commands:  # at most the questions before the line were sent
        return True
    if parts or (isinstance(failure, Refused) and not failure.certain):
        return False
    return isinstance(failure, (Refused, Inexpressible, Differs))


def _has_error(drive: Drive, before: _DriveBefore, text: str, failure: BaseException, at: float) -> bool:
    """Whether a drive has an error, or may have one, that may have started its routine for errors.

    A reply that is damaged or lost may be the refusal of a line for which the tables do not vouch.
    """
    if not _has_routine(drive) or drive.requests == before.requests:
        return False
    if isinstance(failure, NoAnswer) and text and not drive.family.vouched(text, drive.product):
        return True
    return isinstance(failure, Refused) or drive.state.errors.at > at


async def _after_error(automations: Automations, automation: Automation, drive: Drive) -> None:
    """Record that a drive may have been started by its routine for errors, unless it is read to be at rest."""
    before = automation.started.get(drive)
    automations.records(automation, drive, Started(), at_rest.ROUTINE)
    if await at_rest.at_rest_after_error(drive):
        automations.restores(automation, drive, before)
