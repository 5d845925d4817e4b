"""Byte pipes: serial, TCP, UDP, RFC 2217. They carry bytes and interpret none."""

from transports.base import Lost, Preemptible, Received, Transport, TransportLost, Unreachable

__all__ = ["Lost", "Preemptible", "Received", "Transport", "TransportLost", "Unreachable"]
