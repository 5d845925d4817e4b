import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.dialects import Hints
from multidrop.shell.configuration import SavedConnection
from multidrop.shell.connect.schemes import schemes
from multidrop.shell.connect.urls import KEYS, parse


@pytest.mark.parametrize(
    ("url", "scheme", "target"),
    [
        ("/dev/ttyUSB0", "serial", "/dev/ttyUSB0"),
        ("COM3", "serial", "COM3"),
        ("com12?baud=9600", "serial", "com12"),
        ("./press.tty", "serial", "./press.tty"),
        ("cell/press.tty", "serial", "cell/press.tty"),
        ("serial:/dev/ttyUSB0?baud=9600", "serial", "/dev/ttyUSB0"),
        ("serial:press.tty", "serial", "press.tty"),
        ("sim:", "sim", ""),
        ("sim:cell.toml", "sim", "cell.toml"),
        ("SIM:cell.toml", "sim", "cell.toml"),
    ],
)
def test_a_port_or_a_cell_is_a_target(url, scheme, target):
    found = parse(url)
    assert (found.scheme.name, found.target, found.text) == (scheme, target, url)


@pytest.mark.parametrize(
    ("url", "host", "port"),
    [
        ("tcp://10.0.0.5:503", "10.0.0.5", 503),
        ("tcp://drive.local", "drive.local", 503),
        ("udp://10.0.0.5", "10.0.0.5", 503),
        ("modbus://10.0.0.5", "10.0.0.5", 502),
        ("rfc2217://gateway:2217?baud=9600", "gateway", 2217),
        ("tcp://[::1]:5031/", "::1", 5031),
    ],
)
def test_network_urls_give_host_and_port(url, host, port):
    found = parse(url)
    assert (found.host, found.port) == (host, port)


@pytest.mark.parametrize(
    ("url", "user", "host", "port", "target", "short"),
    [
        ("ssh://pc3/dev/ttyUSB0", "", "pc3", 0, "/dev/ttyUSB0", "pc3-ttyUSB0"),
        ("ssh://fitter@pc3.plant:2222/dev/ttyUSB0?drives=a,b", "fitter", "pc3.plant", 2222, "/dev/ttyUSB0", None),
        ("ssh://[::1]/dev/serial/by-path/pci-0000:00:14.0-port0", "", "::1", 0, None, None),
        ("SSH://pc3/dev/a%20port", "", "pc3", 0, "/dev/a port", None),
    ],
)
def test_a_port_of_another_machine_has_a_login_and_a_path(url, user, host, port, target, short):
    found = parse(url)
    assert (found.scheme.name, found.user, found.host, found.port) == ("ssh", user, host, port)
    assert target in (None, found.target) and short in (None, found.short)
    again = parse(found.scheme.shown(found, ""))
    assert (again.user, again.host, again.port) == (user, host, port)


def test_a_port_of_another_machine_is_one_port_whoever_logs_in():
    assert parse("ssh://fitter@PC3/dev/ttyUSB0").port_name == parse("ssh://pc3/dev/ttyUSB0?baud=19200").port_name
    assert parse("ssh://pc3/dev/ttyUSB1").port_name != parse("ssh://pc3/dev/ttyUSB0").port_name


def test_a_bus_of_a_cell_stands_behind_a_hash_before_or_after_the_keys():
    assert parse("sim:#press").bus == "press"
    for url in ("sim:cell.toml#press?em=1", "sim:cell.toml?em=1#press"):
        found = parse(url)
        assert (found.target, found.bus, found.hints.em) == ("cell.toml", "press", 1)


def test_every_key_reaches_its_place():
    keys = "dialect=mcode&drives=a,b,!&baud=19200&party=1&checksum=2&em=3&echo=local&timeout=0.5"
    found = parse(f"/dev/ttyUSB0?{keys}")
    assert found.hints == Hints(family="mcode", drives=("a", "b", "!"), party=True, checksum=2, em=3)
    assert (found.baud, found.local_echo, found.timeout) == (19200, True, 0.5)
    assert parse("tcp://h:1?address=none").hints.addressed is False
    assert parse("tcp://h:1?party=0").hints.party is False


def test_what_is_not_given_is_left_to_be_found_out():
    assert parse("/dev/ttyUSB0").hints == Hints()


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("/dev/ttyUSB0?bawd=9600", ["bawd", "baud", "checksum"]),
        ("/dev/ttyUSB0?baud=fast", ["baud=fast", "300 to 1000000"]),
        ("/dev/ttyUSB0?em=4", ["em=4", "0 to 3"]),
        ("/dev/ttyUSB0?em=", ["em=", "0 to 3"]),
        ("/dev/ttyUSB0?party=yes", ["party=yes", "0 or 1"]),
        ("/dev/ttyUSB0?drives=", ["drives=", "a,b,c"]),
        ("/dev/ttyUSB0?drives=a,a", ["drives=a,a", "different"]),
        ("/dev/ttyUSB0?drives=*", ["drives=*"]),
        ("/dev/ttyUSB0?drives=a,-b", ["drives=a,-b"]),
        ("/dev/ttyUSB0?drives=%3D1", ["drives"]),
        ("tcp://-h:503", ["//HOST:PORT"]),
        ("/dev/ttyUSB0?dialect=gcode", ["dialect=gcode", "mcode or pmx"]),
        ("/dev/ttyUSB0?em=1&em=1", ["em", "twice"]),
        ("/dev/ttyUSB0?timeout=0", ["timeout=0", "0.01 to 600"]),
        ("/dev/ttyUSB0?address=none&drives=a,b", ["address=none"]),
        ("/dev/ttyUSB0#press", ["press", "sim:"]),
        ("serial:", ["without a port"]),
        ("tcp:10.0.0.5", ["//HOST:PORT", "tcp://10.0.0.5:503"]),
        ("tcp://h:99999", ["99999", "65535"]),
        ("rfc2217://h", ["no port"]),
        ("ssh://pc3", ["no port, on pc3", "ssh://user@host/dev/ttyUSB0"]),
        ("ssh://pc3/", ["no port, on pc3"]),
        ("ssh://-oProxyCommand=x/dev/ttyUSB0", ["[USER@]HOST[:PORT]"]),
        ("ssh://-l@pc3/dev/ttyUSB0", ["[USER@]HOST[:PORT]"]),
        ("ssh://pc3;reboot/dev/ttyUSB0", ["[USER@]HOST[:PORT]"]),
        ("ssh://pc3:99999/dev/ttyUSB0", ["99999", "65535"]),
        ("ssh://pc3/dev/tty%0aUSB0", ["control character"]),
        ("ssh://pc3/dev/ttyUSB0\\", ["backslash"]),
        ("ssh://pc3/dev/ttyUSB0?relay=nc", ["relay nc", "multidrop or socat"]),
        ("/dev/ttyUSB0?relay=socat", ["relay=", "ssh://"]),
        ("http://h", ["http", "tcp://"]),
        ("press", ["press", "saved connection"]),
        ("", ["empty"]),
    ],
)
def test_what_is_wrong_is_one_line_that_names_it_and_what_is_allowed(url, words):
    with pytest.raises(Diagnostic) as caught:
        parse(url)
    text = str(caught.value)
    assert "\n" not in text
    assert [word for word in words if word not in text] == []


def test_a_saved_connection_gives_its_url_its_name_and_its_labels():
    saved = {"press": SavedConnection("press", "serial:/dev/ttyUSB0?drives=a,b", {"a": "gantry"})}
    found = parse("press", saved)
    assert (found.target, found.hints.drives, found.short) == ("/dev/ttyUSB0", ("a", "b"), "press")
    assert found.labels == {"a": "gantry"}


def test_a_wrong_saved_url_says_whose_it_is():
    with pytest.raises(Diagnostic, match="connection press: .*em=9"):
        parse("press", {"press": SavedConnection("press", "/dev/x?em=9", {})})


def test_a_bus_is_called_after_its_port_or_host():
    assert parse("/dev/ttyUSB0").short == "ttyUSB0"
    assert parse("tcp://10.0.0.5:503").short == "10.0.0.5"
    assert (parse("tcp://10.0.0.5:504").by_port, parse("/dev/ttyUSB0").by_port) == ("10.0.0.5-504", "")


words = st.text(st.sampled_from("ab019:/?&=#,._-%[]@ CMsimtcp"), max_size=30)


@given(
    st.one_of(
        st.text(max_size=30),
        words,
        st.builds("{}:{}?{}={}".format, st.sampled_from([*schemes()]), words, st.sampled_from([*KEYS]), words),
    )
)
def test_any_text_is_a_connection_or_one_line_of_complaint(text):
    try:
        found = parse(text)
    except Diagnostic as problem:
        assert str(problem)
    else:
        assert found.scheme in schemes().values()
        assert found.target or found.host or found.scheme.simulated


@given(
    em=st.integers(0, 3),
    checksum=st.integers(0, 2),
    baud=st.integers(300, 1_000_000),
    drives=st.lists(st.from_regex(r"[A-Za-z0-9!]{1,3}", fullmatch=True), min_size=1, max_size=5, unique=True),
)
def test_what_is_written_is_what_is_read(em, checksum, baud, drives):
    found = parse(f"serial:/dev/x?em={em}&checksum={checksum}&baud={baud}&drives={','.join(drives)}")
    assert found.hints == Hints(em=em, checksum=checksum, drives=tuple(drives))
    assert found.baud == baud
