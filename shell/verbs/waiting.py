"""Verbs that wait: for a time, for drives to stand, for programs to end, for a value, for a text."""

from __future__ import annotations

import re

from shell import waits
from shell.lines import split_target
from shell.verbs.registry import Call, as_typed, verb

_TEXT = re.compile(r"""(?P<quote>["'])(?P<text>.+?)(?P=quote)(?:\s+(?P<seconds>\S+))?""")
_VALUE = re.compile(r"(?P<condition>(?:@\S+\s+)?[^\s=!<>]+\s*[=!<>]=?\s*\S+)(?:\s+(?P<seconds>\S+))?")


@verb("/sleep SECONDS", recorded=as_typed)
async def sleep(call: Call) -> None:
    """Wait for a time."""
    (text,) = call.words(1, 1)
    await waits.sleep(waits.seconds(text, call.wrong))


def _with_drive(call: Call) -> str:
    """Record the line, with the selected drive's address for a value."""
    line = as_typed(call)
    if not _VALUE.fullmatch(call.rest) or call.rest.startswith("@"):
        return line
    target = call.workspace.qualified_address(call.workspace.drive())
    return f"{call.verb.name} @{target} {call.rest}" if target else line


@verb(
    '/wait stopped|idle [SECONDS] | [@ADDR] WORD=VALUE [SECONDS] | "TEXT" [SECONDS]',
    recorded=_with_drive,
    words={"stopped": "until all drives stand", "idle": "until all drives stand and no program runs"},
)
async def wait(call: Call) -> None:
    """Wait until the drives stand (idle: and no program runs), a drive reports a value, or one prints a text.

    It fails after SECONDS, 60 by default. `stopped` waits for every drive that this session sent a line to, or for the
    selected one if there is none: two readings 50 ms apart show velocity 0. `I1=1` asks the selected drive; = may be
    !=, <, <=, > or >=. A text counts since the last line to a drive.
    """
    if match := _TEXT.fullmatch(call.rest):
        await waits.wait_text(call.workspace, match["text"], _limit(call, match["seconds"]))
    elif match := _VALUE.fullmatch(call.rest):
        wanted = waits.condition(match["condition"])
        if wanted is None:
            raise call.wrong(f"no condition {match['condition']}; valid: I1=1, @b P>=51200")
        bus, address = split_target(wanted.target)
        drive = call.workspace.drive(bus, address or None)
        await waits.wait_value(call.workspace, drive, wanted, _limit(call, match["seconds"]))
    else:
        words = call.words(1, 2)
        if words[0] not in ("stopped", "idle"):
            raise call.wrong()
        limit = _limit(call, words[1] if len(words) > 1 else None)
        await waits.wait(call.workspace, limit, idle=words[0] == "idle")


def _limit(call: Call, text: str | None) -> float:
    """The time limit, s."""
    return waits.LIMIT if text is None else waits.seconds(text, call.wrong)
