"""`multidrop relay`: the far side of `ssh://`, which another multidrop starts."""

from __future__ import annotations

import argparse
import signal
import sys
from types import FrameType

from multidrop.dialects.errors import Diagnostic
from multidrop.transports import TransportLost


def run(chosen: argparse.Namespace) -> int:
    """Lend a port to the multidrop at the other end of standard input and output, until that is gone."""
    try:
        return _serve(chosen)
    except (Diagnostic, TransportLost) as problem:
        from multidrop.commands.failure import fail

        return fail(problem)


def _serve(chosen: argparse.Namespace) -> int:
    if sys.platform == "win32":
        raise Diagnostic(
            "relay needs Linux or macOS", "multidrop relay", "open the port from a program on this machine"
        )
    else:
        if sys.stdin.isatty():
            raise Diagnostic(
                "another multidrop starts this, through ssh, and speaks frames to it",
                "multidrop relay",
                f"open ssh://THIS-HOST{chosen.port} on the other machine",
            )
        if "://" in chosen.port:
            from multidrop.shell.secrets import url_without_secrets

            raise Diagnostic(
                "is no serial port of this machine", url_without_secrets(chosen.port), "as in /dev/ttyUSB0"
            )
        from multidrop.transports.relay import serve
        from multidrop.transports.serial_port import SerialEndpoint, opened

        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, _ended)
        serve(opened(SerialEndpoint, chosen.port, chosen.baud))
        return 0


def _ended(number: int, _: FrameType | None) -> None:
    """End by a signal, and close the port."""
    sys.exit(128 + number)
