"""The command lines of `ssh` and of the far machine, and the reasons of a failure.

The far shell gets one command: it executes `multidrop relay` where that is installed, and `socat` where it is not. Both
take the place of the shell, so that none stays between. The port's path is quoted for that shell: it executes nothing.
"""

from __future__ import annotations

import re
import shlex

from transports.far_port import RELAY, SOCAT, FarPort
from transports.relay_frames import GREETING, WORD

CONNECT = 5
"""Seconds in which ssh must reach the host."""
SOCAT_WORD = "multidrop-socat"
"""The first line of a far side with socat."""
MISSING = 127
"""The far shell's status where neither program is installed."""
_OPTIONS = (
    "BatchMode=yes",  # it asks nothing: no person could answer
    f"ConnectTimeout={CONNECT}",
    "ServerAliveInterval=2",
    "ServerAliveCountMax=2",
    "ClearAllForwardings=yes",  # a person's other connection has them
    "RemoteCommand=none",
    "LogLevel=INFO",
)
_LINE = "raw,echo=0,cs8,parenb=0,cstopb=0,crtscts=0,clocal=1,nonblock,flock-ex-nb"
"""The settings for socat: as for a port here."""
_CLAIM = 'x=,ioctl-void=0x540c; case "$(readlink -f {path})" in /dev/pts/*) x=;; esac'
"""TIOCEXCL shuts out programs that ignore the lock; a pseudo-terminal would keep it after socat has ended."""
_SPECIAL = re.compile(r"""([\\,:!"'()\[\]{}])""")
"""The characters that mean something in an address of socat."""
_HINTS = (
    ("host key verification failed", "run `ssh {login}` once by hand, and compare and accept the key of the host"),
    ("permission denied (", "`ssh {login}` must log in without a password; set up a key with ssh-copy-id"),
    ("could not resolve", "check the spelling, or give its address"),
    ("connection refused", "no ssh server listens there; check the port's number and the server"),
    ("timed out", "check the address, its power and the network"),
    ("no route to host", "check the address, its power and the network"),
    ("invalid choice: 'relay'", "multidrop there is older; install this version there, or add relay=socat to the URL"),
    ("flock(", "another program has the port; close it there"),
    ("no such file", "plug it in there, or look at /dev/serial/by-id there"),
    ("inappropriate ioctl", "it is not a serial port"),
)
"""What to do, by a part of the last line of ssh or of socat."""


def arguments(far: FarPort, baud: int, way: str = "") -> list[str]:
    """The command line of ssh. `way`: one of `WAYS`, or empty to try both."""
    given = ["ssh", "-T", "-e", "none"]
    for option in _OPTIONS:
        given += ["-o", option]
    if far.port:
        given += ["-p", str(far.port)]
    if far.user:
        given += ["-l", far.user]
    return [*given, "--", far.host, f"exec /bin/sh -c {shlex.quote(far_command(far.path, baud, way))}"]


def far_command(path: str, baud: int, way: str = "") -> str:
    """The command for the far shell. Without a terminal its PATH may lack the folder of pipx."""
    relay = f"exec multidrop relay --baud {baud} -- {shlex.quote(path)}"
    address = f"OPEN:{_SPECIAL.sub(_escaped, path)},b{baud},{_LINE}"
    claim = _CLAIM.format(path=shlex.quote(path))
    socat = f'{claim}; echo {SOCAT_WORD}; exec socat STDIO {shlex.quote(address)}"$x"'
    steps = [
        f"if command -v {program} >/dev/null 2>&1; then {command}; fi"
        for program, command in ((RELAY, relay), (SOCAT, socat))
        if way in ("", program)
    ]
    return "; ".join(['PATH="$PATH:$HOME/.local/bin:/usr/local/bin"', *steps, f"exit {MISSING}"])


def _escaped(found: re.Match[str]) -> str:
    return f"\\{found[1]}"


def unknown_greeting(line: str) -> str:
    """The reason to refuse a first line of another version of multidrop; empty for any other line."""
    if not line.startswith(f"{WORD} "):
        return ""
    return f"multidrop there speaks '{line[:40]}', this one '{GREETING}'; install one version on both machines"


def reason(far: FarPort, status: int | None, words: str, way: str = "") -> str:
    """Why the far side ended before its greeting: from the status of ssh and the last line that was said."""
    if status == MISSING:
        lacking = f"{way} is not" if way else "neither multidrop nor socat is"
        also = f" ({words})" if words else ""
        return f"{lacking} installed on {far.host}{also}; install {way or RELAY} there"
    found = next((hint for part, hint in _HINTS if part in words.lower()), "")
    hint = f"; {found.format(login=far.login)}" if found else ""
    if status in (255, None):
        return f"not reached: {words or 'ssh ended without a word'}{hint}"
    if status < 0:
        return f"ssh was ended by signal {-status}"
    if words:
        return words + hint
    there = shlex.quote(far.path)  # for the far shell; this one has to pass it on as it is
    return f"the far side ended with status {status}; try: ssh {far.login} multidrop relay {shlex.quote(there)}"
