"""Byte pipes: serial, TCP, UDP, RFC 2217, ssh. They carry bytes and interpret none."""

from multidrop.transports.base import (
    Controllable,
    Limited,
    Lost,
    PortControl,
    Preemptible,
    Queueing,
    Received,
    Remote,
    Transport,
    TransportLost,
    Unreachable,
)

__all__ = [
    "Controllable",
    "Limited",
    "Lost",
    "PortControl",
    "Preemptible",
    "Queueing",
    "Received",
    "Remote",
    "Transport",
    "TransportLost",
    "Unreachable",
]
