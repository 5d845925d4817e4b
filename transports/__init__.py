"""Byte pipes: serial, TCP, UDP, RFC 2217. They know bytes and nothing else."""

from transports.base import Lost, Preemptible, Received, Transport, TransportLost, Unreachable

__all__ = ["Lost", "Preemptible", "Received", "Transport", "TransportLost", "Unreachable"]
