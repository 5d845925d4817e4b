"""Secrets are taken out of text that leaves this machine."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shell.secrets import without_secrets


@pytest.mark.parametrize(
    ("text", "clean"),
    [
        ('url = "ssh://me:pw@host/dev/ttyUSB0"', 'url = "ssh://***@host/dev/ttyUSB0"'),
        ("mqtt://user@broker/press", "mqtt://***@broker/press"),
        ('password = "pw"', "password = ***"),
        ("mqtt.Password='pw' # mine", "mqtt.Password=***"),
        ('"api-token" = "pw"', '"api-token" = ***'),
        ("tcp://host:1?token=pw&drives=a", "tcp://host:1?token=***&drives=a"),
        ('mqtt = { username = "u", password = "pw" }', 'mqtt = { username = "u", password = ***'),
        ('password = """\npw"""\nca = "a"', 'password = ***\nca = "a"'),
        ("password = '''\npw", "password = ***"),
        ("[connections.press]", "[connections.press]"),
        ('url = "/dev/ttyUSB0?drives=a,b"', 'url = "/dev/ttyUSB0?drives=a,b"'),
        ("@b MR 100", "@b MR 100"),
    ],
)
def test_secrets_are_replaced_and_nothing_else(text, clean):
    assert without_secrets(text) == clean


@given(st.text(alphabet="abc:/@=\"' \n", max_size=60))
def test_what_is_clean_stays_as_it_is(text):
    clean = without_secrets(text)
    assert without_secrets(clean) == clean
