"""The supply of a simulated drive: on, off, without +V, and the time that an Ethernet drive takes to begin anew.

A serial drive is there at once. One with Ethernet is silent for `ETHERNET_BOOT` seconds after it was switched on, reset
(^C, an input of that type) or set to factory defaults, as real ones are; a cell begins with all of its drives up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import simulator.lexium.nvm as nonvolatile
from simulator.lexium.motion.trips import POWER

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

NO_POWER = 79
ETHERNET_BOOT = 20.0
"""Seconds, of the device's own time."""


def switch(device: MCodeDevice, on: bool) -> None:
    """Switch the drive on or off now. What NVM holds stays."""
    if on == (device.powered or device.boots_at is not None):
        return
    if on:
        device.world.powered_up(device.now)
        restart(device)
    else:
        _go_down(device)
        device.prints()


def restart(device: MCodeDevice) -> None:
    """Begin anew now, or when it has booted."""
    if not device.ethernet:
        come_up(device)
        return
    _go_down(device)
    device.boots_at = device.now + ETHERNET_BOOT


def come_up(device: MCodeDevice) -> None:
    """It has booted."""
    device.powered, device.boots_at = True, None
    device.boots += 1
    nonvolatile.boot(device)


def supply(device: MCodeDevice, on: bool) -> None:
    """Switch +V alone, with the auxiliary supply left on (manual 5.1.127)."""
    was, device.axis.supply = device.axis.supply, on
    device.motor.tune()
    if on and not was:
        device.axis.align(device.now)
    if was and not on:
        device.motor.stop(device.now)
        device.raise_error(NO_POWER)
        if device.trips.armed & POWER:
            device.trips.fire(POWER, device.now)
    device.stale = True


def _go_down(device: MCodeDevice) -> None:
    device.motor.stop(device.now)
    device.interpreter.finish()
    device.trips.clear()
    device.powered, device.boots_at = False, None
