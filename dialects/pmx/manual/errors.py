"""The refusals of a controller, with meaning and remedy.

Each begins with a question mark; an unknown command follows it (PMX-2ED-SA manual, table 9.1).
"""

from __future__ import annotations

from typing import NamedTuple


class Meaning(NamedTuple):
    """Meaning and remedy of a refusal."""

    text: str
    advice: str


MEANINGS: dict[str, Meaning] = {
    "?ABS/INC is not in operation": Meaning(
        "the axis makes no positional move whose target could be changed", "T is for X and Y moves under way"
    ),
    "?Clear SNL Error": Meaning("StepNLoop of the axis is in error", "SLSX and SLSY show it; CLRX and CLRY clear it"),
    "?ICommandOn": Meaning("an interpolated move is under way", "its speed cannot be changed on the fly"),
    "?Index out of Range": Meaning("nothing has that number", "/help NAME lists them"),
    "?Invalid Answer": Meaning("it does not take that value", "/help NAME shows the range"),
    "?Low speed out of range": Meaning("the low speed does not fit", "raise LSPD, or LSPDX and LSPDY, for this HSPD"),
    "?Moving": Meaning("the motor is moving", "wait until it is at rest, or STOP or ABORT it"),
    "?S-curve on": Meaning("no speed is changed on the fly with S-curves", "SCVX=0, SCVY=0 switch them off"),
    "?Speed out of range": Meaning(
        "the speed is outside the window of SSPDM", "choose another window while the axis is at rest"
    ),
    "?SSPD Mode not Initialized": Meaning("no speed window is selected", "SSPDMX=1 to 9 while the axis is at rest"),
    "?Sub not Initialized": Meaning("no subroutine of that number is stored", "download a program that has it"),
}
"""By the reply, in the manual's spelling."""
_FOLDED = {reply.casefold().replace(" ", ""): meaning for reply, meaning in MEANINGS.items()}


def meaning(reply: str) -> Meaning | None:
    """Look up a refusal, whatever its spacing and case; None where it only repeats an unknown command."""
    return _FOLDED.get(reply.casefold().replace(" ", ""))
