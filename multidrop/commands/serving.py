"""Commands that serve until interrupted, and small ones: each imports what it needs when it runs.

`multidrop sim`, `relay`, `ports`, `completion`.
"""

from __future__ import annotations

import re
import signal
import sys
from collections.abc import Sequence
from types import FrameType

from multidrop.base.errors import Diagnostic
from multidrop.shell.streams.stdout import fail, write

FILES = {"bash": "multidrop.bash", "zsh": "_multidrop", "fish": "multidrop.fish", "powershell": "multidrop.ps1"}
"""The completion of each shell in `multidrop/shipped`, which `make shipped` writes."""


def sim(cell: str | None, allow: Sequence[str], json: bool, speed: float) -> int:
    """Serve a simulated cell until a signal, or until the reader of its output leaves."""
    import asyncio
    from pathlib import Path

    from multidrop.shell import configuration
    from multidrop.shell.streams.stdout import finish, nonblocking
    from multidrop.simulator.serving.command import serve

    async def body() -> int:
        with nonblocking() as streams:
            try:
                paths = (*map(Path, allow), *(configuration.load().allowed if cell else ()))
                await serve(cell, json=json, speed=speed, stdin=sys.stdin, stdout=sys.stdout, allow=paths)
            except Diagnostic as problem:
                return fail(problem)
            finally:
                await finish(streams, lambda: True)
        return 0

    return asyncio.run(body())


def relay(port: str, baud: int) -> int:
    """Lend a port to the multidrop at the other end of standard input and output, until that is gone."""
    if sys.platform == "win32":
        raise Diagnostic(
            "relay needs Linux or macOS", "multidrop relay", "open the port from a program on this machine"
        )
    else:
        if sys.stdin.isatty():
            raise Diagnostic(
                "another multidrop starts this, through ssh, and speaks frames to it",
                "multidrop relay",
                f"open ssh://THIS-HOST{port} on the other machine",
            )
        from multidrop.base import registry
        from multidrop.shell.relaying import lender

        lent = lender(port)
        write(sys.stderr, *(f"warning: {warning}" for warning in registry.warnings()))
        if lent is not None:
            lent.lend(port.partition(":")[2])
            return 0
        if "://" in port:
            from multidrop.shell.secrets import url_without_secrets

            raise Diagnostic("is no serial port of this machine", url_without_secrets(port), "as in /dev/ttyUSB0")
        from multidrop.transports import Unreachable
        from multidrop.transports.relay import serve
        from multidrop.transports.serial_port import SerialEndpoint, opened

        if re.fullmatch("/?COM[0-9]+", port, re.IGNORECASE):
            raise Unreachable(f"{port.strip('/')} is a port of Windows, and this is none; see `multidrop ports`")

        def ended(number: int, _: FrameType | None) -> None:
            sys.exit(128 + number)  # closes the port

        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, ended)
        serve(opened(SerialEndpoint, port, baud))
        return 0


def ports(as_json: bool) -> int:
    from multidrop.shell.connect.schemes import local_ports

    ports_there = [*local_ports()]
    for port in ports_there:
        if as_json:
            import json

            fact = {"port": port.device, "stable": port.stable_name, "description": port.description}
            write(sys.stdout, json.dumps(fact))
        else:
            write(sys.stdout, "  ".join(part for part in (port.device, port.stable_name, port.description) if part))
    if not ports_there and not as_json:
        write(sys.stderr, "no serial port was found; multidrop demo needs none")
    return 0


def completion(shell: str) -> int:
    from importlib.resources import files

    sys.stdout.write((files("multidrop") / "shipped" / FILES[shell]).read_text(encoding="utf-8"))
    return 0
