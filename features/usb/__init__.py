"""USB: controllers on the USB of this machine and of others, and simulated ones that are plugged in."""

from __future__ import annotations

from contextlib import AsyncExitStack
from typing import Any

from multidrop.base.feature import Feature
from multidrop.dialects.usb import ABSENT
from multidrop.features.usb.schemes import MODULE, Usb, Usbip
from multidrop.shell.connect.scheme import NoLine
from multidrop.simulator.cell.endpoint_kinds import EndpointKind
from multidrop.simulator.cell.spec import Endpoint


async def _export(floor: Any, bus: str, endpoint: Endpoint, stack: AsyncExitStack) -> list[str]:
    from multidrop.features.usb.exports import export

    return await export(floor, bus, endpoint, stack)


def _attaching(endpoint: str) -> str:
    from multidrop.features.usb.exports import attaching

    return attaching(endpoint)


NOTHING = NoLine(("usb", "usbip"), "no family of drives that are on USB is there", "install multidrop again, whole")
FEATURE = Feature(
    "usb",
    "controllers on USB, of this machine and of others",
    adds=(
        Usb(),
        Usbip(),
        EndpointKind("usbip", _export, families=(MODULE.dialect,), lack="has no USB", remark=_attaching),
    )
    if MODULE is not ABSENT
    else (NOTHING,),
    extras={"usb": "usb1"},
)
