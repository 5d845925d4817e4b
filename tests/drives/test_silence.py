"""The causes that a failure names where no drive has replied: by what came, and by who else has the port."""

from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import NoAnswer
from multidrop.drives.echoes import FirstBytes
from multidrop.drives.silence import ECHO, NETWORK, NOISE, SERIAL, explained, reason


def link(came: bytes = b"", network: bool = False, other: str = "", suspects: str = "", written: bytes = b"") -> Any:
    heard = FirstBytes()
    heard.received(came)
    heard.note_written(written)
    transport = SimpleNamespace(network=network, other_user=lambda: other, suspects=lambda: suspects)
    return SimpleNamespace(heard=heard, transport=transport)


NOISY = bytes(range(128, 160))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (link(), f"nothing was received; {SERIAL}"),
        (link(network=True), f"nothing was received; {NETWORK}"),
        (link(suspects="gpsd"), f"nothing was received; {SERIAL}; a service may have the port open: gpsd"),
        (link(other="minicom has it"), "nothing was received; minicom has it"),
        (link(other="minicom has it", suspects="gpsd"), "nothing was received; minicom has it"),
        (link(b"PR P\r", written=b"PR P\r"), f"{ECHO}; {SERIAL}"),
        (link(b"PR P\r", network=True, written=b"PR P\r", other="x"), f"{ECHO}; x"),
    ],
)
def test_the_reason_has_what_came_and_what_to_check(given, text):
    assert reason(given, "mcode") == text
    failure = explained(NoAnswer("no reply"), given, "mcode")
    assert type(failure) is NoAnswer and str(failure) == f"no reply; {text}"


def test_noise_has_its_own_advice():
    text = reason(link(NOISY, suspects="gpsd"), "mcode")
    assert text.endswith(f"another baud rate?{NOISE}; a service may have the port open: gpsd")


def test_whole_messages_are_named_by_the_failure_itself():
    failure = NoAnswer("no reply")
    message = bytes.fromhex("000100000005010302 0007")
    assert reason(link(message, suspects="gpsd"), "modbus") == ""
    assert explained(failure, link(message), "modbus") is failure


def test_after_the_first_reply_only_another_program_is_named():
    replied, shared = link(), link(other="minicom has it")
    replied.heard.replied("a")
    shared.heard.replied("a")
    failure = NoAnswer("no reply")
    assert explained(failure, replied, "mcode") is failure
    named = explained(failure, shared, "mcode")
    assert type(named) is NoAnswer and str(named) == "no reply; minicom has it"
