"""Verbs that wait: for a time, for drives to stand, for programs to end, for a value, for a text."""

from __future__ import annotations

import re
from typing import NamedTuple

from multidrop.shell import waits
from multidrop.shell.lines import split_target
from multidrop.shell.verbs.registry import Call, Verb, as_typed, verb

_TEXT = re.compile(r"""(?P<quote>["'])(?P<text>.+?)(?P=quote)(?:\s+(?P<seconds>\S+))?""")
_VALUE = re.compile(r"(?P<condition>(?:@\S+\s+)?[^\s=!<>]+\s*[=!<>]=?\s*\S+)(?:\s+(?P<seconds>\S+))?")


class _Wait(NamedTuple):
    """A wait as typed: for a text, for a value, or for drives that stand."""

    limit: float
    text: str = ""
    value: waits.Condition | None = None
    idle: bool = False


def _duration(verb: Verb, rest: str) -> float:
    (text,) = verb.arguments(rest, 1, 1)
    return waits.seconds(text, verb.wrong)


def _wait(verb: Verb, rest: str) -> _Wait:
    """Parse a wait. Raises Diagnostic."""
    if match := _TEXT.fullmatch(rest):
        return _Wait(_limit(verb, match["seconds"]), text=match["text"])
    if match := _VALUE.fullmatch(rest):
        wanted = waits.condition(match["condition"])
        if wanted is None:
            raise verb.wrong(f"no condition {match['condition']}; valid: I1=1, @b P>=51200")
        return _Wait(_limit(verb, match["seconds"]), value=wanted)
    words = verb.arguments(rest, 1, 2)
    if words[0] not in ("stopped", "idle"):
        raise verb.wrong()
    return _Wait(_limit(verb, words[1] if len(words) > 1 else None), idle=words[0] == "idle")


def _limit(verb: Verb, text: str | None) -> float:
    """The time limit, s."""
    return waits.LIMIT if text is None else waits.seconds(text, verb.wrong)


@verb("/sleep SECONDS", recorded=as_typed, check=_duration)
async def sleep(call: Call) -> None:
    """Wait for a time."""
    await waits.sleep(_duration(call.verb, call.rest))


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
    check=_wait,
)
async def wait(call: Call) -> None:
    """Wait until the drives stand (idle: and no program runs), a drive reports a value, or one prints a text.

    It fails after SECONDS, 60 by default. `stopped` waits for every drive that this session sent a line to, or for the
    selected one if there is none: two readings 50 ms apart show velocity 0. `I1=1` asks the selected drive; = may be
    !=, <, <=, > or >=. A text counts since the last line to a drive.
    """
    wanted = _wait(call.verb, call.rest)
    if wanted.text:
        await waits.wait_text(call.workspace, wanted.text, wanted.limit)
    elif wanted.value is not None:
        bus, address = split_target(wanted.value.target)
        drive = call.workspace.drive(bus, address or None)
        await waits.wait_value(call.workspace, drive, wanted.value, wanted.limit)
    else:
        await waits.wait(call.workspace, wanted.limit, idle=wanted.idle)
