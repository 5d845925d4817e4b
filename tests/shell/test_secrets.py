"""Secrets are taken out of text that leaves this machine."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.__main__ import main
from multidrop.base.errors import Diagnostic
from multidrop.shell.connect.urls import parse
from multidrop.shell.secrets import HIDDEN, toml_without_secrets, without_secrets


@pytest.mark.parametrize(
    ("text", "clean"),
    [
        ('url = "ssh://me:pw@host/dev/ttyUSB0"', 'url = "ssh://***@host/dev/ttyUSB0"'),
        ("mqtt://user@broker/press", "mqtt://***@broker/press"),
        ("opened mqtt://user:p/w@broker/press now", "opened mqtt://***@broker/press now"),
        ("mqtt://user:12/p@w?x#y@broker/press", "mqtt://***@broker/press"),
        ("ssh://me:p\"w'@pc/dev/ttyUSB0", "ssh://***@pc/dev/ttyUSB0"),
        ('mqtt."password" = "pw"', 'mqtt."password" = ***'),
        ('mqtt . "pass\\u0077ord" = "pw"', 'mqtt . "pass\\u0077ord" = ***'),
        ('"my \\U00000070assword"="pw"', '"my \\U00000070assword"=***'),
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


CONFIGURATION = """# a remark
[connections.press]
url = "ssh://me:p w/PW@host/dev/ttyUSB0?drives=a"   # its line
names = { a = "gantry" }
[mqtt]
username = "shop-7"
"pass\\u0077ord" = '''PW
PW'''
[other.'api token']
deep = ["PW", { x = "PW" }]
"""


def test_a_configuration_keeps_its_form_and_loses_its_secrets() -> None:
    clean = toml_without_secrets(CONFIGURATION)
    assert "PW" not in clean and clean.startswith("# a remark\n[connections.press]\n")
    found = tomllib.loads(clean)
    assert found["connections"]["press"] == {
        "url": "ssh://***@host/dev/ttyUSB0?drives=a",
        "names": {"a": "gantry"},
    }
    assert found["mqtt"] == {"username": "shop-7", "password": HIDDEN}


def test_a_configuration_that_is_no_toml_shows_keys_only() -> None:
    clean = toml_without_secrets(CONFIGURATION + "x = \n")
    assert "PW" not in clean and "gantry" not in clean
    assert "[mqtt]" in clean and "username = ***" in clean


SECRET = "xyzzy"


@given(st.text(alphabet="abz/@:?#&=%\\ '\"[]{},", max_size=12), st.text(alphabet="abz/@:?#&=% ", max_size=12))
def test_no_refusal_of_a_url_quotes_its_password(before: str, after: str) -> None:
    password = f"{before}{SECRET}{after}"
    for scheme in ("tcp", "udp", "modbus", "rfc2217", "ssh", "ftp"):
        url = f"{scheme}://me:{password}@10.0.0.5:503/proxy"
        with pytest.raises(Diagnostic) as refused:
            parse(url)
        assert SECRET not in str(refused.value), url


def test_a_refused_url_keeps_what_is_no_secret() -> None:
    with pytest.raises(Diagnostic, match=r"^tcp://\*\*\*@pc:503: no URL here has a password; write it without"):
        parse("tcp://me:pw@pc:503")
    with pytest.raises(Diagnostic, match=r"^tcp://10.0.0.5:503\?token=\*\*\*: no key token"):
        parse("tcp://10.0.0.5:503?token=pw")


def test_reports_quote_no_password_of_a_url(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.txt").write_text("/open tcp://me:xyzzy@10.0.0.5:503\n")
    assert main(["run", "s.txt", "--on", "sim:#press", "--json", "--junit", "r.xml"]) == 2
    said = capsys.readouterr()
    assert '"sent": "/open tcp://***@10.0.0.5:503"' in said.out
    assert SECRET not in said.out + said.err + (tmp_path / "r.xml").read_text()
    assert main(["relay", "tcp://me:xyzzy@10.0.0.5:503"]) == 2
    assert SECRET not in capsys.readouterr().err
