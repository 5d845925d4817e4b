"""The host's knowledge of one Ethernet drive over Modbus."""

from __future__ import annotations

from dataclasses import dataclass

from multidrop.dialects.modbus.host.codec import Modbus
from multidrop.dialects.state import DriveState


@dataclass(eq=False)
class ModbusState(DriveState):
    """One Ethernet drive over Modbus."""

    codec: Modbus
