"""The requests of a conversation that the drive has taken: only these reach its twin.

A request counts once the whole conversation is over, at the time at which its last byte had left. In a conversation
that succeeded, every request counts but those that the drive refused as damaged, which were repeated. In one that
failed, the last command counts only if the drive acknowledged it. Otherwise its execution is doubtful.
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
    first = result[0] if isinstance(result, tuple) and result else None
    if not isinstance(first, Motion) or not concluded.transactions:
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
