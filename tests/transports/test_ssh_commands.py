"""What ssh and the far shell are told to do, and what a person is told where that fails."""

from __future__ import annotations

import shlex

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.transports.ssh import FarPort
from multidrop.transports.ssh_session import arguments, far_command, reason
from tests.support.cases import for_each

pytestmark = pytest.mark.fork

FAR = FarPort("pc", "/dev/ttyUSB0")
LOGIN = FarPort("pc", "/dev/ttyUSB0", "me", 22)


# The command lines


@for_each(
    "far, given",
    [
        (FAR, ["--", "pc"]),
        (LOGIN, ["-p", "22", "-l", "me", "--", "pc"]),
        (FarPort("::1", "/dev/ttyS0", port=2222), ["-p", "2222", "--", "::1"]),
        (FarPort("pc", "/dev/ttyS0", "me"), ["-l", "me", "--", "pc"]),
    ],
)
def test_ssh_asks_nothing_and_is_told_host_user_and_port(far: FarPort, given: list[str]) -> None:
    *before, command = arguments(far, 19200, "socat")
    assert before[:4] == ["ssh", "-T", "-e", "none"]
    options, rest = before[4 : -len(given)], before[-len(given) :]
    assert rest == given
    assert options[::2] == ["-o"] * 7
    assert options[1::2] == [
        "BatchMode=yes",
        "ConnectTimeout=5",
        "ServerAliveInterval=2",
        "ServerAliveCountMax=2",
        "ClearAllForwardings=yes",
        "RemoteCommand=none",
        "LogLevel=INFO",
    ]
    assert shlex.split(command) == ["exec", "/bin/sh", "-c", far_command(far.path, 19200, "socat")]


_PATH = 'PATH="$PATH:$HOME/.local/bin:/usr/local/bin"'
_RELAY = "if command -v multidrop >/dev/null 2>&1; then exec multidrop relay --baud 9600 -- /dev/ttyUSB0; fi"
_SOCAT = (
    "if command -v socat >/dev/null 2>&1; then "
    'x=,ioctl-void=0x540c; case "$(readlink -f /dev/ttyUSB0)" in /dev/pts/*) x=;; esac; '
    "echo multidrop-socat; exec socat STDIO "
    "OPEN:/dev/ttyUSB0,b9600,raw,echo=0,cs8,parenb=0,cstopb=0,crtscts=0,clocal=1,nonblock,flock-ex-nb"
    '"$x"; fi'
)


@for_each(
    "way, steps",
    [("", [_RELAY, _SOCAT]), ("multidrop", [_RELAY]), ("socat", [_SOCAT])],
)
def test_the_far_shell_tries_multidrop_and_then_socat_or_the_one_that_was_asked_for(way: str, steps: list[str]) -> None:
    assert far_command("/dev/ttyUSB0", 9600, way) == "; ".join([_PATH, *steps, "exit 127"])


@given(st.text(st.characters(exclude_characters="\\", categories=["L", "N", "P", "S", "Zs"]), min_size=1))
def test_the_ports_path_is_one_word_for_the_far_shell_and_one_address_for_socat(name: str) -> None:
    path = f"/dev/{name}"
    relay = far_command(path, 9600, "multidrop").partition(" -- ")[2].rpartition("; fi; exit 127")[0]
    assert shlex.split(relay) == [path]
    address = far_command(path, 9600, "socat").partition("exec socat STDIO ")[2].rpartition('"$x"; fi')[0]
    (word,) = shlex.split(address)
    escaped, *_ = word.removeprefix("OPEN:").rpartition(",b9600,raw,")
    read, at = "", 0
    while at < len(escaped):
        assert escaped[at] not in ",:!\"'()[]{}", "socat reads a meaning in it"
        at += escaped[at] == "\\"
        read += escaped[at]
        at += 1
    assert read == path


# The reasons


@for_each(
    "status, words, way, told",
    [
        (
            255,
            "Host key verification failed",
            "",
            "not reached: Host key verification failed; run `ssh -p 22 me@pc` once by hand, and compare and accept the "
            "key of the host",
        ),
        (
            255,
            "me@pc: Permission denied (publickey)",
            "",
            "not reached: me@pc: Permission denied (publickey); `ssh -p 22 me@pc` must log in without a password; set "
            "up a key with ssh-copy-id",
        ),
        (
            255,
            "ssh: Could not resolve hostname pc: Name or service not known",
            "",
            "not reached: ssh: Could not resolve hostname pc: Name or service not known; check the spelling, or give "
            "its address",
        ),
        (
            255,
            "Connection timed out",
            "",
            "not reached: Connection timed out; check the address, its power and the net",
        ),
        (255, "No route to host", "", "not reached: No route to host; check the address, its power and the network"),
        (255, "Kex failed", "", "not reached: Kex failed"),
        (255, "", "", "not reached: ssh ended without a word"),
        (None, "", "", "not reached: ssh ended without a word"),
        (None, "Connection refused", "", "not reached: Connection refused; no ssh server listens there"),
        (256, "Kex failed", "", "Kex failed"),
        (127, "", "", "neither multidrop nor socat is installed on pc; install multidrop there"),
        (127, "no such", "", "neither multidrop nor socat is installed on pc (no such); install multidrop there"),
        (127, "", "socat", "socat is not installed on pc; install socat there"),
        (127, "", "multidrop", "multidrop is not installed on pc; install multidrop there"),
        (-9, "", "", "ssh was ended by signal 9"),
        (-15, "Killed", "", "ssh was ended by signal 15"),
        (0, "", "", "the far side ended with status 0; try: ssh -p 22 me@pc multidrop relay /dev/ttyUSB0"),
        (3, "", "", "the far side ended with status 3; try: ssh -p 22 me@pc multidrop relay /dev/ttyUSB0"),
        (0, "this account is closed", "", "this account is closed"),
        (2, "error: invalid choice: 'relay' (choose", "", "error: invalid choice: 'relay' (choose; multidrop there is"),
        (1, "flock(5): busy", "", "flock(5): busy; another program has the port; close it there"),
        (1, "open: No such file", "", "open: No such file; plug it in there, or look at /dev/serial/by-id there"),
        (1, "Inappropriate ioctl for device", "", "Inappropriate ioctl for device; it is not a serial port"),
        (1, "'exec' is not recognized as an operable program or batch file", "", "its shell is one of Windows, where"),
        (255, "exec : the name of a cmdlet", "", "its shell is one of Windows, where the relay does not run; there `"),
        (1, "CommandNotFoundException", "", "its shell is one of Windows"),
    ],
)
def test_the_reason_of_an_end_is_what_was_said_and_what_to_do(
    status: int | None, words: str, way: str, told: str
) -> None:
    found = reason(LOGIN, status, words, way)
    assert found.startswith(told) and "\n" not in found
    whole = (found, told)
    assert "; " in told or "Windows" in told or whole[0] == told, "no advice for what is not known"


def test_for_a_windows_machine_the_way_through_rfc2217_is_told() -> None:
    assert reason(FarPort("pc", "/COM3", "me"), 1, "not an operable program or batch file", "").endswith(
        "; there `multidrop share COM3 --rfc2217 2217`, here `ssh -L 2217:127.0.0.1:2217 me@pc` and "
        "rfc2217://127.0.0.1:2217"
    )
