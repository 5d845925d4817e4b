"""Opening a serial port, and the reasons why it fails; without an event loop, which `multidrop relay` does not need."""

from __future__ import annotations

import contextlib
import errno
import os
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from multidrop.transports.base import Unreachable

T = TypeVar("T")


def opened(kind: Callable[[str, int], T], port: str, baud: int) -> T:
    """Open a port by one of the classes for it. Raises Unreachable with the reason and the remedy."""
    try:
        return kind(port, baud)
    except OSError as error:
        raise open_error(port, error) from error
    except (ValueError, OverflowError) as error:
        raise Unreachable(f"{port}: cannot be set to {baud} baud ({error})") from error


def open_error(port: str, error: OSError) -> Unreachable:
    """Make the reason and the remedy from the error that pyserial raised on opening a port."""
    why = _why_on_windows(port, str(error)) if sys.platform == "win32" else _why(port, error)
    return Unreachable(why or f"{port} could not be opened: {error.strerror or error}")


def _why(port: str, error: OSError) -> str:
    number = error.errno
    if number in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK):
        return f"{port} is in use by {_owner(port)}; close it there"
    if number in (errno.EACCES, errno.EPERM):
        return f"no permission to open {port}; `sudo usermod -aG {shlex.quote(_group(port))} $USER`, then log in again"
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR):
        return _nothing(port)
    if number in (errno.EISDIR, errno.ENOTTY) or "configure" in str(error):
        return f"{port} is not a serial port, or has no hardware; see `multidrop ports`"
    return f"{port} could not be opened: {os.strerror(number)}" if number else ""


def _why_on_windows(port: str, text: str) -> str:
    """Reason on Windows, where pyserial gives no number but only the text of the error."""
    if "PermissionError" in text:
        return f"{port} is in use by another program; close it there"
    return _nothing(port) if "FileNotFoundError" in text else ""


def _nothing(port: str) -> str:
    return f"no port {port}; plug it in, or see `multidrop ports`"


def _owner(port: str) -> str:
    from multidrop.transports.holders import holder

    return holder(port) or "another program"


def _group(port: str) -> str:
    """The group that may use a port; most distributions call it `dialout`."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError, KeyError):
            owner = Path(port).group()
            return owner if owner != "root" else "dialout"
    return "dialout"
