"""The bytes that the system has taken and not yet sent."""

from __future__ import annotations

import fcntl
import struct
import sys
import termios

assert sys.platform != "win32"


def output_queue(descriptor: int) -> int:
    """Bytes of a tty that have not left the kernel, or of a stream socket that are not confirmed."""
    try:
        return int(struct.unpack("i", fcntl.ioctl(descriptor, termios.TIOCOUTQ, bytes(4)))[0])
    except OSError:
        return 0
