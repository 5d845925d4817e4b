"""A port of another machine: how it is named for a person, for a shell, and which paths have no name there."""

from __future__ import annotations

import shlex

from multidrop.transports.ssh import FarPort, wrong_path
from tests.support.cases import for_each


@for_each(
    "far, place, login",
    [
        (FarPort("pc", "/dev/ttyUSB0"), "pc", "pc"),
        (FarPort("pc", "/dev/ttyUSB0", "me"), "me@pc", "me@pc"),
        (FarPort("pc", "/dev/ttyUSB0", port=22), "pc:22", "-p 22 pc"),
        (FarPort("pc", "/dev/ttyUSB0", "me", 2222), "me@pc:2222", "-p 2222 me@pc"),
        (FarPort("fe80::1", "/dev/ttyUSB0", "me", 22), "me@[fe80::1]:22", "-p 22 me@fe80::1"),
        (FarPort("pc", "/dev/ttyUSB0", "my name"), "my name@pc", "'my name@pc'"),
    ],
)
def test_a_far_port_is_named_as_a_url_and_for_an_ssh_by_hand(far: FarPort, place: str, login: str) -> None:
    assert (far.place, far.name, far.login) == (place, f"ssh://{place}/dev/ttyUSB0", login)
    assert shlex.split(login)[-1].endswith(far.host)


def test_signs_with_a_meaning_in_a_url_are_written_as_numbers() -> None:
    assert FarPort("pc", "/dev/a?b#c%d").name == "ssh://pc/dev/a%3Fb%23c%25d"


@for_each(
    "path, why",
    [
        ("/dev/ttyUSB0", ""),
        ('/dev/it\'s \u00e4 "port"', ""),
        ("dev/ttyUSB0", "no port"),
        ("/dev/", "no port"),
        ("/", "no port"),
        ("", "no port"),
        ("dev/", "no port"),
        ("/dev/a\\b", "a backslash or a control character in the port's path"),
        ("/dev/a\nb", "a backslash or a control character in the port's path"),
        ("/dev/a\\\x1b", "a backslash or a control character in the port's path"),
    ],
)
def test_a_path_that_the_far_shell_cannot_get_is_refused_with_the_reason(path: str, why: str) -> None:
    assert wrong_path(path) == why
