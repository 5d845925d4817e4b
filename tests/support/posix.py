"""What only POSIX has, for tests that use it here and there: `from tests.support.posix import pty`.

Under Windows the first use skips the test. A file of which every test needs POSIX says so in its `pytestmark`, and is
not even imported there.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, NoReturn

import pytest

LEFT_OUT = {
    "pty": "needs pseudo-terminals",
    "fork": "needs signals, modes, limits, links or pipes of POSIX",
    "AF_UNIX": "needs AF_UNIX",
    "tmux": "needs tmux",
}
"""Markers of tests that Windows is not given, and why. No other test is left out there."""

MODULES = {
    "pty": "pty",
    "tty": "pty",
    "termios": "pty",
    "pexpect": "pty",
    "fcntl": "fork",
    "resource": "fork",
}
"""Modules that only POSIX has, and the marker of a test that uses one."""

OF_OS = ("openpty", "mkfifo", "fork", "killpg", "getpgid", "geteuid", "getuid")
OF_SIGNAL = ("HUP", "KILL", "STOP", "CONT", "TSTP", "QUIT", "PIPE", "USR1", "USR2", "WINCH", "ALRM")
NAMES = {
    "os": {name: "pty" if name == "openpty" else "fork" for name in OF_OS},
    "signal": {name: "fork" for name in (*(f"SIG{each}" for each in OF_SIGNAL), "pthread_kill", "pthread_sigmask")},
    "socket": {"AF_UNIX": "AF_UNIX"},
}
"""Of other modules, names that only POSIX has."""


def left_out(marker: str) -> NoReturn:
    """Skip a test, or a module from its top."""
    pytest.skip(f"{marker}: {LEFT_OUT[marker]}", allow_module_level=True)


def only_posix(failure: pytest.ExceptionInfo[BaseException]) -> str | None:
    """Return the marker of a test whose own line, none of the product, asked for a name that only POSIX has."""
    error = failure.value
    if not isinstance(error, AttributeError) or "tests" not in failure.traceback[-1].path.parts:
        return None
    return NAMES.get(getattr(error.obj, "__name__", ""), {}).get(error.name or "")


def has_mode(path: Path, mode: int) -> bool:
    """Whether a file has these permissions, where files have any."""
    return sys.platform == "win32" or path.stat().st_mode & 0o7777 == mode


class Absent:
    """Stands for a module; any use of it skips."""

    def __init__(self, name: str) -> None:
        self.__name__ = name

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        left_out(MODULES[self.__name__])


if sys.platform != "win32":
    import fcntl as fcntl
    import pty as pty
    import resource as resource
    import termios as termios
    import tty as tty

    import pexpect as pexpect
else:
    fcntl, pty, resource = Absent("fcntl"), Absent("pty"), Absent("resource")
    termios, tty, pexpect = Absent("termios"), Absent("tty"), Absent("pexpect")
