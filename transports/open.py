"""All functions that open a transport. Import this only to open one: it imports pyserial."""

from transports.listing import PortInfo, list_ports
from transports.rfc2217 import open_rfc2217
from transports.serial_port import open_serial
from transports.sockets import open_tcp, open_udp

__all__ = ["PortInfo", "list_ports", "open_rfc2217", "open_serial", "open_tcp", "open_udp"]
