"""multidrop: a terminal and a scripting shell for motion drives on a shared line.

The public Python API (`docs/api.md`), imported from `multidrop.api` on first use:

    with multidrop.connect("/dev/ttyUSB0?drives=a,b") as session:
        a = session.drive("a")
        a.move(51200)
        a.wait()
        print(a.position, a.send("PR VM"))
"""

from __future__ import annotations

import importlib
import os

TYPE_CHECKING = False  # `typing` is not imported: this file runs at the start of every command

if TYPE_CHECKING:
    from typing import Any

    from multidrop.api.blocking import Drive as Drive
    from multidrop.api.blocking import Events as Events
    from multidrop.api.blocking import Session as Session
    from multidrop.api.blocking import Telemetry as Telemetry
    from multidrop.api.blocking import connect as connect
    from multidrop.api.calls import Lost as Lost
    from multidrop.api.calls import StopReport as StopReport
    from multidrop.api.drives import AsyncDrive as AsyncDrive
    from multidrop.api.drives import Limits as Limits
    from multidrop.api.events import AsyncEvents as AsyncEvents
    from multidrop.api.events import Event as Event
    from multidrop.api.events import Fault as Fault
    from multidrop.api.sessions import AsyncSession as AsyncSession
    from multidrop.api.sessions import Run as Run
    from multidrop.api.sessions import connect_async as connect_async
    from multidrop.api.simulated import SimulatedCell as SimulatedCell
    from multidrop.api.simulated import simulate as simulate
    from multidrop.api.telemetry import AsyncTelemetry as AsyncTelemetry
    from multidrop.api.telemetry import Sample as Sample
    from multidrop.api.telemetry import Samples as Samples
    from multidrop.api.telemetry import read_rrd as read_rrd
    from multidrop.base.errors import Diagnostic as Diagnostic
    from multidrop.base.errors import Differs as Differs
    from multidrop.base.errors import DriveError as DriveError
    from multidrop.base.errors import Inexpressible as Inexpressible
    from multidrop.base.errors import MotionFailed as MotionFailed
    from multidrop.base.errors import NoAnswer as NoAnswer
    from multidrop.base.errors import Refused as Refused
    from multidrop.base.errors import Stopped as Stopped
    from multidrop.base.errors import Timeout as Timeout
    from multidrop.base.errors import TransportLost as TransportLost
    from multidrop.base.errors import Unreferenced as Unreferenced
    from multidrop.transports import Unreachable as Unreachable

__version__ = "0.1.0"
if not os.path.isdir(os.path.join(__path__[0], "shell")):  # a checkout without symbolic links: the rooms lie beside
    __path__.append(os.path.dirname(os.path.abspath(__path__[0])))
_PLACES = {
    "multidrop.api.blocking": "Drive Events Session Telemetry connect",
    "multidrop.api.calls": "Lost StopReport",
    "multidrop.api.drives": "AsyncDrive Limits",
    "multidrop.api.events": "AsyncEvents Event Fault",
    "multidrop.api.sessions": "AsyncSession Run connect_async",
    "multidrop.api.simulated": "SimulatedCell simulate",
    "multidrop.api.telemetry": "AsyncTelemetry Sample Samples read_rrd",
    "multidrop.base.errors": (
        "Diagnostic Differs DriveError Inexpressible MotionFailed NoAnswer Refused Stopped Timeout TransportLost "
        "Unreferenced"
    ),
    "multidrop.transports": "Unreachable",
}
_PUBLIC = {name: module for module, names in _PLACES.items() for name in names.split()}
__all__ = [*_PUBLIC]


if not TYPE_CHECKING:  # else a checker of types would take any name

    def __getattr__(name: str) -> Any:
        if name not in _PUBLIC:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(importlib.import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    """The public names, for Tab."""
    return sorted((*__all__, "__version__", "__doc__"))
