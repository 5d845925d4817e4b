"""Byte pipes: serial, TCP, UDP, RFC 2217. They carry bytes and interpret none."""

from transports.base import (
    Controllable,
    Lost,
    PortControl,
    Preemptible,
    Received,
    Transport,
    TransportLost,
    Unreachable,
)

__all__ = [
    "Controllable",
    "Lost",
    "PortControl",
    "Preemptible",
    "Received",
    "Transport",
    "TransportLost",
    "Unreachable",
]
