"""Verbs that wait: for a time, for drives to stand, for programs to end."""

from __future__ import annotations

from shell import waits
from shell.verbs.registry import Call, as_typed, verb


@verb("/sleep SECONDS", recorded=as_typed)
async def sleep(call: Call) -> None:
    """Wait for a time."""
    (text,) = call.words(1, 1)
    await waits.sleep(waits.seconds(text, call.wrong))


@verb(
    "/wait stopped|idle [SECONDS]",
    recorded=as_typed,
    words={"stopped": "until all drives stand", "idle": "until all drives stand and no program runs"},
)
async def wait(call: Call) -> None:
    """Wait until the drives stand; idle: and until no program runs.

    It fails after SECONDS, 60 by default. It waits for every drive that this session sent a line to, or for the
    selected one if there is none. A drive stands when two readings 50 ms apart show velocity 0.
    """
    words = call.words(1, 2)
    if words[0] not in ("stopped", "idle"):
        raise call.wrong()
    limit = waits.seconds(words[1], call.wrong) if len(words) > 1 else waits.LIMIT
    await waits.wait(call.workspace, limit, idle=words[0] == "idle")
