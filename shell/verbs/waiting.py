"""Operations that wait: for a time, for drives at rest, for a value or a text of one."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING, Annotated, NamedTuple

from multidrop.shell.operations.operation import Group, Operation, typed
from multidrop.shell.operations.parameter import Argument, Listed

if TYPE_CHECKING:
    from multidrop.shell.session import Call
    from multidrop.shell.waits import WaitCondition

_TEXT = re.compile(r"""(?P<quote>["'])(?P<text>.+?)(?P=quote)(?:\s+(?P<seconds>\S+))?""")
_VALUE = re.compile(r"(?P<condition>(?:@\S+\s+)?[^\s=!<>]+\s*[=!<>]=?\s*(?:\{[^{}]*\}|\S+))(?:\s+(?P<seconds>\S+))?")


class TextWait(NamedTuple):
    """A text that a drive prints, and the seconds in which it does."""

    text: str
    seconds: float | None


class ValueWait(NamedTuple):
    """A value that a drive reports, and the seconds in which it does."""

    value: WaitCondition
    seconds: float | None


def _seconds(text: str) -> float:
    from multidrop.shell import waits

    return waits.seconds(text, argparse.ArgumentTypeError)


def _text(text: str) -> TextWait:
    match = _TEXT.fullmatch(text)
    if match is None:
        raise argparse.ArgumentTypeError("a quotation mark is not closed" if text[:1] in ("'", '"') else "")
    return TextWait(match["text"], None if match["seconds"] is None else _seconds(match["seconds"]))


def _value(text: str) -> ValueWait:
    from multidrop.shell import waits

    match = _VALUE.fullmatch(text)
    if match is None:
        raise argparse.ArgumentTypeError("")
    wanted = waits.condition(match["condition"])
    if wanted is None:
        raise argparse.ArgumentTypeError(f"no condition {match['condition']}; valid: I1=1, @b P>=51200")
    return ValueWait(wanted, None if match["seconds"] is None else _seconds(match["seconds"]))


Seconds = Annotated[float, Argument(metavar="SECONDS", read=_seconds)]
Rest = Annotated[
    str,
    Argument(
        words={
            "stopped": "until all drives are at rest, and their motions ended well",
            "idle": "the same, and no program is running",
            "ended": "until all drives are at rest, however their motions ended",
        }
    ),
]
Value = Annotated[
    ValueWait, Argument(metavar="[@ADDR] WORD=VALUE [SECONDS]", rest=True, read=_value, listed=(Listed.AT_DRIVE,))
]
Text = Annotated[TextWait, Argument(metavar='"TEXT" [SECONDS]', rest=True, read=_text)]


async def sleep(call: Call, seconds: Seconds) -> None:
    from multidrop.shell import waits

    await waits.sleep(seconds)


async def wait(call: Call, state: Rest, seconds: Seconds | None = None) -> None:
    from multidrop.dialects.motions import Outcome
    from multidrop.shell import waits

    limit = waits.WAIT_TIMEOUT if seconds is None else seconds
    watch = await waits.wait(call.session, call.origin, limit, idle=state == "idle", ended=state == "ended")
    if state != "ended":
        return
    ending = watch.worst
    outcome = Outcome.REACHED if ending is None else ending[1].outcome
    if (asked := call.origin.outcome) is not None:
        asked[:] = [outcome.value]
    told = "" if ending is None else f" ({ending[1].described(call.session.display_name(ending[0]))})"
    call.session.notify(f"outcome: {outcome.value}{told}", outcome=True)


async def wait_value(call: Call, wanted: Value) -> None:
    from multidrop.shell import waits

    value, limit = wanted.value, waits.WAIT_TIMEOUT if wanted.seconds is None else wanted.seconds
    drive, units = call.drive(value.target), call.session.units if value.quantity else None
    await waits.wait_value(call.session, call.origin, drive, value, limit, units)


async def wait_text(call: Call, wanted: Text) -> None:
    from multidrop.shell import waits

    await waits.wait_text(
        call.session, call.origin, wanted.text, waits.WAIT_TIMEOUT if wanted.seconds is None else wanted.seconds
    )


def with_drive(call: Call) -> str:
    """Record the line with the selected drive's address."""
    target = "" if call.rest.startswith("@") else call.session.qualified_address(call.session.drive())
    return f"{call.verb.name} @{target} {call.rest}" if target else typed(call)


OPERATIONS = (
    Operation(
        wait,
        verb="/wait",
        group=Group.WAITS,
        recorded=typed,
        checked=True,
        help="""
Wait until the drives are at rest (idle: and no program is running), a drive reports a value, or one prints a text.

It fails after SECONDS, 60 by default. `stopped` waits for every drive that this session sent a line to, or for the
selected one if there is none: two readings 50 ms apart show velocity 0. It also fails if a motion did not end as it
should: at a limit, by a stall or another error, by a stop that is not from the same script, or if its end cannot be
read. `ended` accepts every ending and reports it; in a script it sets `{outcome}` to reached, replaced, stopped, limit,
stall, error, power or unknown. `I1=1` asks the selected drive; = may be !=, <, <=, > or >=. A text counts since the
last line to a drive.
""",
    ),
    Operation(wait_value, verb="/wait", recorded=with_drive),
    Operation(wait_text, verb="/wait", recorded=typed),
    Operation(sleep, verb="/sleep", group=Group.WAITS, recorded=typed, checked=True, help="Wait for a time."),
)
