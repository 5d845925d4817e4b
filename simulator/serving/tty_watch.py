"""The number of clients that have a pseudo-terminal open, counted without polling.

A simulator that holds both ends of a pseudo-terminal gets no signal when its client comes or goes. On Linux inotify
reports it; elsewhere the number is unknown, and a client is assumed.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys

_OPEN, _CLOSE = 0x20, 0x08 | 0x10
_EVENT = struct.Struct("iIII")


class TtyWatch:
    """Counts the clients of a device file from now on. `fd` is readable when the count changes; None: unknown."""

    def __init__(self, path: str) -> None:
        self.fd = _watch(path)
        self._clients = 0

    def clients(self) -> int | None:
        """The number of clients now; None if it is unknown."""
        if self.fd is None:
            return None
        while True:
            try:
                data = os.read(self.fd, 4096)
            except BlockingIOError:
                return self._clients
            at = 0
            while at < len(data):
                _, mask, _, length = _EVENT.unpack_from(data, at)
                self._clients += bool(mask & _OPEN) - bool(mask & _CLOSE)
                at += _EVENT.size + length

    def deserted(self) -> bool:
        """Whether no client has it open. Quick to ask; the end of the last client may be seen a moment late."""
        return self._clients == 0 and self.clients() == 0

    def close(self) -> None:
        """Stop watching."""
        if self.fd is not None:
            os.close(self.fd)
            self.fd = None


def _watch(path: str) -> int | None:
    """Open an inotify descriptor for opens and closes of `path`; None if that is not possible."""
    if sys.platform != "linux":
        return None
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        fd: int = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, AttributeError):
        return None
    if fd < 0:
        return None
    if libc.inotify_add_watch(fd, os.fsencode(path), _OPEN | _CLOSE) < 0:
        os.close(fd)
        return None
    return fd
