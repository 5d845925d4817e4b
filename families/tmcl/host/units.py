"""Quantities in commands of TMCL, and what a motor of a module counts.

Positions are microsteps: 2 to the power of axis parameter 140 a full step; no command reports the full steps of a turn.
Modules with a TMC428 or TMC429 take velocities and accelerations in units of that chip, which the divisors 154 and 153
scale; others take microsteps/s and microsteps/s2, unless 255 is 0. (TMCL firmware manuals, "Axis parameters".)
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from fractions import Fraction

from multidrop.base.errors import Refused
from multidrop.dialects.codec import Procedure, Request
from multidrop.dialects.units import FULL_STEPS, VALUE, Basis, Field, Takes, Units
from multidrop.families.tmcl.host.codec import TmclState, call_of
from multidrop.families.tmcl.host.operations import read
from multidrop.families.tmcl.manual import commands
from multidrop.families.tmcl.manual.commands import AxisParameter, Command, TmclCall
from multidrop.families.tmcl.manual.modules import module_of
from multidrop.families.tmcl.manual.parameters import AXIS, MEASURED, SCALES

CLOCK = 16_000_000
"""Of the chip, Hz."""
_SET = [number for number in MEASURED if AXIS[number].writable]
_SETTING = re.compile(r"(\d{1,3})(?:_(\d))?", re.ASCII)
_LINE = re.compile(rf"\s*(?:(ROR)|(MVP)\s+(ABS|REL)\s*,|(SAP)\s+(\d+)\s*,)\s*(\d+)\s*,\s*{VALUE}\s*", re.I)


def _axis(state: TmclState, motor: int) -> str:
    return str(motor) if state.motors > 1 else ""


class TmclUnits(Units):
    """The quantities in lines of TMCL."""

    state: TmclState

    words = f"MVP ABS, MVP REL, ROR, and SAP of {', '.join(map(str, sorted(_SET)))}"

    def axes(self) -> Sequence[str]:
        return [str(motor) for motor in range(self.state.motors)] if self.state.motors > 1 else [""]

    def fields(self, text: str) -> Sequence[Field]:
        match = _LINE.fullmatch(text)
        if match is None:
            return ()
        if match[1]:
            takes: Takes | None = Takes.VELOCITY
        elif match[2]:
            takes = Takes.PLACE if match[3].upper() == "ABS" else Takes.DISTANCE
        else:
            takes = MEASURED.get(int(match[5]))
        moves = bool(match[2]) or (match[5] is not None and int(match[5]) == AxisParameter.TARGET_POSITION)
        return (Field(_axis(self.state, int(match[6])), takes, *match.span(7), moves),) if takes is not None else ()

    def basis(self, axis: str, full_steps: int | None) -> Procedure[Basis]:
        motor, settings = int(axis or 0), {}
        for parameter in SCALES:
            if parameter == AxisParameter.MICROSTEPS or parameter in module_of(self.state.product).axis:
                try:
                    settings[int(parameter)] = yield from read(self.state, TmclCall(Command.GAP, parameter, motor))
                except Refused:  # a module without it has no such divisor
                    continue
        named = tuple((f"{number}", str(value)) for number, value in settings.items())
        if AxisParameter.MICROSTEPS not in settings:
            return Basis(named, missing="the module does not report its microsteps (140)")
        turn = Fraction((full_steps or FULL_STEPS) * 2 ** settings[AxisParameter.MICROSTEPS])
        assumed = "" if full_steps else f"{FULL_STEPS} full steps a turn are assumed"
        if not settings.get(AxisParameter.UNIT_MODE, 1):
            return Basis(named, turn, None, None, assumed)
        if not module_of(self.state.product).chip_units:
            return Basis(named, turn, assumed=assumed)
        pulse, ramp = settings.get(AxisParameter.PULSE_DIVISOR), settings.get(AxisParameter.RAMP_DIVISOR)
        if pulse is None or ramp is None:
            return Basis(named, turn, None, None, assumed)
        speed = Fraction(2**pulse * 2048 * 32, CLOCK)
        return Basis(named, turn, speed, Fraction(2 ** (pulse + ramp + 29), CLOCK**2), assumed)

    def disturbs(self, text: str) -> Collection[str]:
        call = commands.parsed(text)
        if call is None:
            return ()
        if call.command == Command.FACTORY:
            return self.axes()
        sets = call.command in (Command.SAP, Command.RSAP) and call.type in (AxisParameter.ACTUAL_POSITION, *SCALES)
        return (_axis(self.state, call.motor),) if sets else ()

    def recounts(self, request: Request) -> bool:
        _, call = call_of(request.body)
        if call.command == Command.FACTORY:
            return True
        return call.command in (Command.SAP, Command.RSAP) and call.type in SCALES

    def reads(self, text: str) -> tuple[str, Takes] | None:
        call = commands.parsed(text)
        known = call is not None and call.command == Command.GAP and call.type in MEASURED
        return (_axis(self.state, call.motor), MEASURED[call.type]) if call is not None and known else None

    def setting(self, name: str) -> tuple[str, Takes] | None:
        match = _SETTING.fullmatch(name)
        takes = MEASURED.get(int(match[1])) if match is not None else None
        return (_axis(self.state, int(match[2] or 0)), takes) if match is not None and takes is not None else None

    def setting_name(self, axis: str, name: str) -> str:
        return commands.setting_name(f"{name}_{axis}" if axis else name)
