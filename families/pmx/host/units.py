"""Quantities in commands of the controller, and what an axis counts.

An axis counts pulses, or encoder counts while StepNLoop is on (SL). How many of them a turn has is set by jumpers and
by the encoder, which no command reports, so a scale is by the step. Accelerations are times, so they take no quantity.
A move `X1000` is to a position or by a distance, as MM says. (PMX-2ED-SA manual 5.1, 7.1, 7.4, 7.8, 7.17.)
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from multidrop.dialects.codec import Procedure, Request
from multidrop.dialects.units import VALUE, Basis, Field, Takes, Units
from multidrop.families.pmx.host.codec import PmxState
from multidrop.families.pmx.host.operations import number
from multidrop.families.pmx.manual.table import AXES, RECOUNTING, SCALES

SPEEDS = ("HSPD", "LSPD", "SSPD")
_MOVE = re.compile(rf"\s*(?:X{VALUE})?(?:Y{VALUE})?\s*|\s*I{VALUE}:{VALUE}\s*")
_SET = re.compile(rf"\s*(P|{'|'.join(SPEEDS)})([XY])={VALUE}\s*")
_READ = re.compile(rf"\s*(P|PS|{'|'.join(SPEEDS[:2])})([XY])\s*")
_RECOUNTS = re.compile(rf"\s*(?:{'|'.join(SCALES)})[XY]=")
_DISTURBS = re.compile(rf"\s*(?:{'|'.join(RECOUNTING)})([XY])=")


class PmxUnits(Units):
    """The quantities in lines of a PMX."""

    state: PmxState

    words = f"X, Y, I, PX, PY, {', '.join(f'{word}X, {word}Y' for word in SPEEDS)}"

    def axes(self) -> Sequence[str]:
        return [axis.lower() for axis in AXES]

    def fields(self, text: str) -> Sequence[Field]:
        if (match := _SET.fullmatch(text)) is not None:
            takes = Takes.PLACE if match[1] == "P" else Takes.SPEED
            return (Field(match[2].lower(), takes, *match.span(3)),)
        match = _MOVE.fullmatch(text)
        groups = zip((1, 2, 3, 4), "xyxy", strict=True) if match is not None else ()
        return [Field(axis, Takes.TARGET, *match.span(n), True) for n, axis in groups if match is not None and match[n]]

    def basis(self, axis: str, full_steps: int | None) -> Procedure[Basis]:
        names = [f"{word}{axis.upper()}" for word in reversed(SCALES)]  # StepNLoop first
        settings = []
        for name in names:
            settings.append((name, str((yield from number(self.state, name)))))
        return Basis(tuple(settings), missing="the controller does not report the steps of a turn")

    def disturbs(self, text: str) -> Collection[str]:
        match = _DISTURBS.match(text)
        return (match[1].lower(),) if match is not None else ()

    def recounts(self, request: Request) -> bool:
        return _RECOUNTS.match(request.text) is not None

    def reads(self, text: str) -> tuple[str, Takes] | None:
        match = _READ.fullmatch(text)
        return (match[2].lower(), Takes.PLACE if match[1] == "P" else Takes.SPEED) if match is not None else None

    def target(self) -> Procedure[Takes]:
        return Takes.DISTANCE if (yield from number(self.state, "MM")) else Takes.PLACE
