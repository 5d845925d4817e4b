"""The communication settings of a simulated drive, read from its memory."""

from __future__ import annotations

from multidrop.simulator.lexium.state.memory import Memory


class CommSettings:
    """Manual 5.1.19, 5.1.21, 5.1.31, 5.1.33, 5.1.37, 5.1.39, 5.1.41, 5.1.105, 5.1.106."""

    def __init__(self, memory: Memory) -> None:
        self.memory = memory

    @property
    def name(self) -> str:
        """DN."""
        return self.memory.texts["DN"]

    @property
    def party(self) -> bool:
        """PY."""
        return bool(self.memory.values.get("PY"))

    @property
    def checksum(self) -> int:
        """CK."""
        return int(self.memory.values.get("CK", 0))

    @property
    def echo_mode(self) -> int:
        """EM."""
        return int(self.memory.values["EM"])

    @property
    def escape_mode(self) -> int:
        """ES."""
        return int(self.memory.values["ES"])

    @property
    def reset_mode(self) -> int:
        """CE."""
        return int(self.memory.values["CE"])

    @property
    def quiet_global(self) -> bool:
        """DG."""
        return bool(self.memory.values.get("DG", 1))

    @property
    def queued(self) -> bool:
        """QD."""
        return bool(self.memory.values.get("QD"))

    @property
    def ethernet(self) -> bool:
        """Whether it is reached over Ethernet."""
        return self.memory.model.ethernet

    @property
    def flags_by_nak(self) -> bool:
        """Whether with a checksum everything is answered by NAK while the error flag is set."""
        return self.memory.model.flags_by_nak

    @property
    def error_flag(self) -> bool:
        """EF."""
        return bool(self.memory.values["EF"])
