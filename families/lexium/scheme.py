"""The URL of a drive's registers."""

from __future__ import annotations

from multidrop.shell.connect.schemes import Tcp


class ModbusScheme(Tcp):
    """The registers of a drive with Ethernet, over a stream of bytes."""

    name, prefix, example = "modbus", "modbus://", "modbus://HOST:502"
    meaning = "an Ethernet drive's registers"
    port = 502
    turns = 0.0
    after = "udp"
