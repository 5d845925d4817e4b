"""What a family declares of the USB interface of its drives."""

from __future__ import annotations

from typing import NamedTuple

from multidrop.base import registry


class UsbModule(NamedTuple):
    """Drives on USB, each with one pipe of lines: in the record of a family."""

    dialect: str
    """The language that they speak there."""
    title: str
    """One of them, for a person: `an X controller`."""
    module: str
    """What its interface is called: `X controller`."""
    vendor: int
    product: int
    texts: tuple[str, str] = ("", "")
    """What a simulated one says of its maker and its product."""


ABSENT = UsbModule("", "a controller", "controller", 0, 0)
"""No family has drives on USB."""


def usb_module() -> UsbModule:
    """The drives on USB; ABSENT where no family has any."""
    return next(registry.records(registry.families(), UsbModule), ABSENT)
