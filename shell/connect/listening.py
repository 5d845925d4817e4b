"""The address at which a command listens, as a person gives it: PORT or HOST:PORT."""

from __future__ import annotations

from multidrop.dialects import Diagnostic
from multidrop.dialects.text import whole
from multidrop.shell.secrets import url_without_secrets

HOST = "127.0.0.1"


def listening(text: str) -> tuple[str, int]:
    """Host and port (0: a free one). Raises Diagnostic."""
    host, _, port = text.rpartition(":")
    number = whole(port, 0, 65535)
    if number is None:
        raise Diagnostic(f"no port {url_without_secrets(text)!r} to serve at", hint="valid: PORT or HOST:PORT, as 9876")
    return host.removeprefix("[").removesuffix("]") or HOST, number
