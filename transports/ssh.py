"""A serial port of another machine: its place, and the programs there that lend it. Its imports are quick."""

from __future__ import annotations

import shlex
from dataclasses import dataclass

from multidrop.transports import Unreachable

RELAY = "multidrop"
SOCAT = "socat"
WAYS = (RELAY, SOCAT)
"""The programs on the far side; both are tried in this order unless one is asked for."""


WORD = r"[A-Za-z0-9_.][A-Za-z0-9_.-]*"
"""The name of a user or a host: `ssh` takes a first `-` for an option."""


class NotInstalled(Unreachable):
    """None of the programs that were tried is installed on the far side."""


_IN_URL = str.maketrans({"%": "%25", "?": "%3F", "#": "%23"})


@dataclass(frozen=True)
class FarPort:
    """A serial port of another machine."""

    host: str
    path: str
    user: str = ""
    port: int = 0
    """The ssh server's port; 0: as the user's own configuration says."""

    @property
    def name(self) -> str:
        """The URL without keys."""
        path = self.path.translate(_IN_URL)
        return f"ssh://{self.place}{path}"

    @property
    def place(self) -> str:
        """User, host and port as in a URL."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return (f"{self.user}@" if self.user else "") + host + (f":{self.port}" if self.port else "")

    @property
    def login(self) -> str:
        """The arguments of an `ssh` by hand, quoted for a shell."""
        user = f"{self.user}@" if self.user else ""
        return (f"-p {self.port} " if self.port else "") + shlex.quote(user + self.host)


def wrong_path(path: str) -> str:
    """Why a path cannot be passed to the far shell; empty if it can."""
    if not path.startswith("/") or path.endswith("/"):
        return "no port"
    if "\\" in path or not path.isprintable():
        return "a backslash or a control character in the port's path"
    return ""
