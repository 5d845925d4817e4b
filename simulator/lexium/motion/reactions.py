"""What an input of a dedicated type does when it becomes active, or ceases to be.

Limits are the device's own matter, trips that of `trips`, home and clocks that of the motion. What the manual leaves
open (3.4.3, 5.1.64, 7.2.3): G0 does nothing while a program runs; pause lasts as long as its input is active; a jog
lasts as long, is left alone by an axis that something else moves, and both ways at once are neither; a soft stop of a
motion is error 91, of a program 48, which is the one that stays if it stops both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dialects.mcode.manual.grammar import Number
from simulator.lexium.state.errors import Fault

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

GO, SOFT_STOP, PAUSE, JOG_PLUS, JOG_MINUS, RESET = 4, 5, 6, 7, 8, 11
PROGRAM_STOPPED, MOTION_STOPPED, JOG_AND_CLOCK = 48, 91, 87
GO_ADDRESS = Number(1)
RESET_TIME = 0.01
"""s, before the line of SU that follows a reset by an input."""


def risen(device: MCodeDevice, kind: int) -> None:
    """An input of a type has become active."""
    try:
        if kind == GO and not device.interpreter.running:
            device.interpreter.start(GO_ADDRESS, device.now)
        elif kind == SOFT_STOP:
            _soft_stop(device)
        elif kind == PAUSE and device.interpreter.running and not device.interpreter.paused:
            device.interpreter.pause(device.now)
        elif kind in (JOG_PLUS, JOG_MINUS):
            jog(device)
        elif kind == RESET:
            _reset(device)
    except Fault as fault:
        error(device, fault.code)


def _reset(device: MCodeDevice) -> None:
    """Begin anew. SU takes a moment to start, or one that sets up such an input would reset the drive in no time."""
    device.restart()
    if device.interpreter.running:
        device.interpreter.next_at = device.now + RESET_TIME


def fallen(device: MCodeDevice, kind: int) -> None:
    """An input of a type is not active any more."""
    try:
        if kind == PAUSE and device.interpreter.paused:
            device.interpreter.resume(device.now)
        elif kind in (JOG_PLUS, JOG_MINUS):
            jog(device)
    except Fault as fault:
        error(device, fault.code)


def jog(device: MCodeDevice) -> None:
    """Turn as the jog inputs and JE say now. Raises Fault for a motion that may not begin."""
    way = 0
    if device.memory.values["JE"] and device.inputs.watched:
        if device.memory.values.get("CM"):
            raise Fault(JOG_AND_CLOCK)
        way = device.inputs.wants(JOG_PLUS) - device.inputs.wants(JOG_MINUS)
    before = device.jogging
    if way == before or (not before and device.axis.moving(device.now)):
        return
    device.jogging = 0
    device.stale = True
    if way:
        device.axis.slew(way * int(device.memory.values["VM"]), device.now)
        device.jogging = way
    elif device.axis.kind == "SL":
        device.axis.slow_to(0, device.now)
        device.interpreter.drop_motion()


def try_jog(device: MCodeDevice) -> None:
    """The same for what has changed by a line, which is not refused for a motion that may not begin."""
    try:
        jog(device)
    except Fault as fault:
        error(device, fault.code)


def wired(device: MCodeDevice, n: int, was: tuple[int, ...]) -> None:
    """An input has been set up anew. One that is active already stops or resets at once; a jog ends with its input.

    Where the level that is active has changed too, it is for the look at the inputs to see that.
    """
    kind, active = device.inputs.types[n][:2]
    if not device.inputs.watched:
        return
    if kind != was[0] and active == was[1] and device.inputs.active(n) and kind in (SOFT_STOP, RESET):
        risen(device, kind)
    if device.jogging or kind in (JOG_PLUS, JOG_MINUS):
        try_jog(device)


def error(device: MCodeDevice, code: int) -> None:
    """An error that no line has caused: the register, the flag, and the handler."""
    device.set_error(code)
    device.interpreter.on_error(device.now)
    device.stale = True


def _soft_stop(device: MCodeDevice) -> None:
    interpreter = device.interpreter
    if interpreter.paused:
        return
    running, moving = interpreter.running, device.axis.moving(device.now)
    if moving:
        if not device.motor.hmt.halt():
            device.axis.slow_to(0, device.now)
        device.set_error(MOTION_STOPPED)
    if running:
        interpreter.finish()
        device.set_error(PROGRAM_STOPPED)
    if moving or running:
        device.jogging = 0
        interpreter.on_error(device.now)
        device.stale = True
