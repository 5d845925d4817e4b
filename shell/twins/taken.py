"""What a drive has taken of a conversation: only that reaches its twin.

A request counts once the whole conversation is over, at the time at which its last byte had left. In one that succeeded
every request counts that the drive did not refuse by itself (a damaged frame is repeated). In one that failed, the last
command counts only if the drive acknowledged it: it was refused, or it is not known whether it was executed.
"""

from __future__ import annotations

from collections.abc import Iterator

from dialects import End, Priority
from dialects.family import Motion
from drives.conclusions import Concluded
from drives.conversations import ASKING
from drives.events import Transaction

NOT_TAKEN = (End.REFUSED, End.NAK, End.STOPPED)


def reading_took(concluded: Concluded) -> float | None:
    """The time between the first and the last request of a reading of motion, s; None for another conversation."""
    result = concluded.outcome.result[0] if concluded.outcome.result else None
    if not (isinstance(result, tuple) and result and isinstance(result[0], Motion) and concluded.transactions):
        return None
    return concluded.transactions[-1].transmitted_at - concluded.transactions[0].transmitted_at


def taken(concluded: Concluded) -> Iterator[Transaction]:
    """Yield the transactions of which the drive has taken the request; no polls."""
    commands = [each for each in concluded.transactions if each.request.kind not in ASKING]
    failed_with = commands[-1] if concluded.outcome.error is not None and commands else None
    for each in concluded.transactions:
        doubtful = each is failed_with and not each.reply.acknowledged
        polled = each.request.priority is Priority.POLL
        if each.sent and each.reply.end not in NOT_TAKEN and not doubtful and not polled:
            yield each
