"""What is published: topics, limits, the backlog, the URL of a broker, the login in the configuration."""

from __future__ import annotations

import json
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.events import Conditioned, Sample
from multidrop.features.publishing import feed
from multidrop.features.publishing.broker import BrokerMessage, Target, parse_target
from multidrop.features.publishing.feed import BURST, RATE, UNCHANGED, LineLimit, PublishedCurve, Topics, escape
from multidrop.features.publishing.login import MqttSettings
from multidrop.features.publishing.publisher import Backlog
from multidrop.features.publishing.registry import (
    AT_REST,
    LOST,
    MOVING,
    NO_CURRENT,
    DriveValues,
    PublishedValue,
    SampleLimit,
    error_of,
    parse_rate,
)
from multidrop.shell import configuration
from multidrop.shell.log.files import LogEntry

# Topics


@pytest.mark.parametrize(
    ("name", "level"),
    [
        ("press", "press"),
        ("00", "00"),
        ("", "!"),
        ("!", "%21"),
        ("a/b", "a%2Fb"),
        ("a+b#c", "a%2Bb%23c"),
        ("100%", "100%25"),
        ("%2F", "%252F"),
        ("$SYS", "%24SYS"),
        ("a$", "a$"),
        ("a\x00\x1f\x7f\x9f", "a%00%1F%7F%C2%9F"),
        ("Café 2", "Café 2"),
        ("\ufffe", "%EF%BF%BE"),
        ("\udc80", "%ED%B2%80"),
    ],
)
def test_a_name_is_one_level(name: str, level: str) -> None:
    assert escape(name) == level


@given(st.text(st.characters(codec=None), max_size=12))
def test_a_level_gives_its_name_again_and_is_one_that_mqtt_takes(name: str) -> None:
    level = escape(name)
    assert ("" if level == "!" else unquote(level, errors="surrogatepass")) == name
    assert level and not set(level) & set("+#/\0") and not level.startswith("$")
    level.encode("utf-8")


@given(st.text("ab!%$/\0", max_size=4), st.text("ab!%$/\0", max_size=4))
def test_two_names_have_two_levels(one: str, other: str) -> None:
    assert (escape(one) == escape(other)) == (one == other)


def test_the_topics_are_those_of_the_contract() -> None:
    topics = Topics("plant/hall")
    assert topics.status == "plant/hall/status"
    assert topics.bus_status("press") == "plant/hall/press/status"
    assert topics.transcript("press") == "plant/hall/press/transcript"
    assert topics.drive("press", "a", "position") == "plant/hall/press/a/position"


# The broker's URL


@pytest.mark.parametrize(
    ("text", "target", "shown"),
    [
        ("mqtt://broker/plant", Target("broker", 1883, "plant"), "mqtt://broker:1883/plant"),
        ("mqtts://broker/a/b/", Target("broker", 8883, "a/b", True), "mqtts://broker:8883/a/b"),
        ("mqtt://me@h:1/p", Target("h", 1, "p", False, "me"), "mqtt://h:1/p"),
        ("mqtt://me%40plant@h/p", Target("h", 1883, "p", False, "me@plant"), "mqtt://h:1883/p"),
        ("mqtt://[::1]:18/p", Target("::1", 18, "p"), "mqtt://[::1]:18/p"),
    ],
)
def test_a_broker_is_what_was_typed(text: str, target: Target, shown: str) -> None:
    assert parse_target(text) == target
    assert parse_target(text).text == shown


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("broker/plant", "begins with mqtt://"),
        ("http://broker/plant", "begins with mqtt://"),
        ("mqtt://broker", "no PREFIX"),
        ("mqtt://broker/", "no PREFIX"),
        ("mqtt:///plant", "no address ''"),
        ("mqtt://h:x/p", "no address 'h:x'"),
        ("mqtt://h:0/p", "no address 'h:0'"),
        ("mqtt://h:70000/p", "no address"),
        ("mqtt://[::1/p", "no address"),
        ("mqtt://h?x/p", "no address"),
        ("mqtt://h/a+", "a PREFIX has no +"),
        ("mqtt://h/a#b", "a PREFIX has no #"),
        ("mqtt://h/a?retain=0", "a PREFIX has no ?"),
        ("mqtt://h/a\x1b", r"a PREFIX has no \x1b"),
        ("mqtt://h/$SYS", "begins without $"),
        ("mqtt://h/a//b", "no level of it is empty"),
        ("mqtt://h/" + "a" * 2000, "at most 1000 bytes"),
    ],
)
def test_a_wrong_broker_is_said(text: str, says: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        parse_target(text)
    assert says in str(caught.value) and str(caught.value).startswith("--to")


@pytest.mark.parametrize("scheme", ["mqtt", "mqtts", "http", "mqtt:"])
def test_a_password_in_the_url_is_refused_and_never_repeated(scheme: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        parse_target(f"{scheme}://me:hunter2@h/p")
    assert "hunter2" not in str(caught.value)
    assert scheme not in ("mqtt", "mqtts") or "[mqtt]" in str(caught.value)


# Limits


@pytest.mark.parametrize(("text", "period"), [("2", 0.5), ("0.01", 100.0), ("50", 0.02)])
def test_a_rate_is_samples_a_second(text: str, period: float) -> None:
    assert parse_rate(text) == pytest.approx(period)


@pytest.mark.parametrize("text", ["0", "-1", "51", "max", "nan", "inf", ""])
def test_a_wrong_rate_is_said(text: str) -> None:
    with pytest.raises(Diagnostic, match="--rate"):
        parse_rate(text)


@given(st.lists(st.floats(0, 3), min_size=1, max_size=60))
def test_no_more_samples_pass_than_the_rate_allows(gaps: list[float]) -> None:
    limit, at, passed = SampleLimit(1.0), 0.0, []
    for gap in gaps:
        at += gap
        if limit.passes(at):
            passed.append(at)
    assert passed
    assert len(passed) <= passed[-1] - passed[0] + 2
    assert all(later - earlier >= 0.5 - 1e-9 for earlier, later in zip(passed, passed[1:], strict=False))


def test_a_poll_that_comes_a_little_early_passes() -> None:
    limit = SampleLimit(0.5)
    assert [limit.passes(at) for at in (0.0, 0.501, 0.999, 1.2, 1.5)] == [True, True, True, False, True]


def test_a_value_that_rests_is_published_every_few_seconds_and_a_change_with_the_point_before_it() -> None:
    curve = PublishedCurve()
    points = [PublishedValue(at / 2, datetime.now(UTC), {"value": 0 if at < 24 else at}) for at in range(27)]
    published = [point.at for each in points for point in curve.take(each)]
    assert published == [0.0, UNCHANGED, 2 * UNCHANGED, 11.5, 12.0, 12.5, 13.0]


def test_a_flood_of_lines_is_limited_and_what_is_missing_is_counted() -> None:
    limit = LineLimit()
    passed = sum(limit.passes(second / 1000) for second in range(10_000))
    assert passed == pytest.approx(BURST + 10 * RATE, abs=2)
    assert limit.missing(9.999) == 0  # there is no room for the line that says it
    assert limit.missing(10.1) == 10_000 - passed
    assert limit.missing(20.0) == 0


# The backlog


def test_the_oldest_message_is_dropped_and_counted_by_its_line() -> None:
    backlog = Backlog(3)
    for number, bus in enumerate("aabba"):
        backlog.put(BrokerMessage(str(number), "", bus=bus))
    assert (len(backlog), backlog.dropped, backlog.first()) == (3, 2, BrokerMessage("2", "", bus="b"))
    assert backlog.take_dropped() == Counter(a=2)
    assert backlog.dropped == 0
    backlog.give_back([BrokerMessage("x", "")])
    assert backlog.take_dropped() == Counter({"": 1})  # the oldest of all


def test_retained_messages_are_renewed_and_the_newest_is_the_last() -> None:
    backlog = Backlog()
    old, new, line = BrokerMessage("s", "old", True), BrokerMessage("s", "new", True), BrokerMessage("t", "1")
    for each in (old, line, new):
        backlog.put(each)
    for _ in range(3):
        backlog.sent()
    backlog.give_back([old, line])
    backlog.renew()
    backlog.renew()
    found = []
    while (first := backlog.first()) is not None:
        found.append(first)
        backlog.sent()
    assert found == [old, line, new]


# Texts


def test_a_value_is_json_with_a_time_as_in_the_log() -> None:
    time = datetime(2026, 11, 22, 14, 3, 7, 123, UTC)
    assert json.loads(feed.value_text(time, {"value": 5, "axis": "x"})) == {
        "time": "2026-11-22T14:03:07.000123+00:00",
        "value": 5,
        "axis": "x",
    }
    assert "axis" not in feed.value_text(time, {"value": 5, "axis": ""})


def test_the_error_is_that_of_the_first_axis_that_has_one() -> None:
    fine, wrong = Conditions(axis="x"), Conditions(axis="y", error=5, error_text="limit")
    assert error_of([fine]) == {"value": 0, "text": ""}
    assert error_of([fine, wrong]) == {"value": 5, "text": "limit", "axis": "y"}
    assert "clear" in str(error_of([Conditions(error=UNREAD)])["text"])


@pytest.mark.parametrize(
    ("name", "port", "shown"),
    [
        ("press", "tcp://10.0.0.5:4001", "press"),
        ("10.0.0.5", "tcp://10.0.0.5:4001", "10.0.0.5:4001"),
        ("10.0.0.5-4001", "rfc2217://10.0.0.5:4001", "10.0.0.5:4001"),
        ("ttyUSB0", "/dev/ttyUSB0", "ttyUSB0"),
        ("10.0.0.5-rig", "tcp://10.0.0.5:4001", "10.0.0.5-rig"),
    ],
)
def test_a_line_that_is_named_after_its_host_is_shown_with_its_port(name: str, port: str, shown: str) -> None:
    bus: Any = SimpleNamespace(name=name, link=SimpleNamespace(transport=SimpleNamespace(name=port)))
    assert feed.shown_name(bus) == shown


def test_a_line_is_an_entry_of_the_log_without_secrets_and_of_bounded_length() -> None:
    entry = LogEntry(datetime.now(UTC), "printed", "password = x\n" + "y" * 5000, "press", "a")
    text = feed.line_text(entry)
    found = json.loads(text)
    assert (found["kind"], found["bus"], found["drive"]) == ("printed", "press", "a")
    assert "***" in found["text"] and len(text) < 1200 and "\n" not in text


# The configuration


def test_the_login_is_read_and_paths_begin_at_the_configuration(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("hunter2\n")
    where = str(tmp_path / "multidrop.toml")
    found = configuration.parse(
        '[mqtt]\nusername = "u"\npassword_file = "secret"\nca = "/etc/ca.pem"\n', where
    ).section("mqtt")
    assert found == MqttSettings("u", password_file=str(tmp_path / "secret"), ca="/etc/ca.pem")
    assert found.secret() == "hunter2"
    assert [*found.unreadable()] == ["mqtt.ca: /etc/ca.pem cannot be read: No such file or directory"]
    assert "hunter2" not in repr(MqttSettings(password="hunter2"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("mqtt = 1", "mqtt is not a table"),
        ('[mqtt]\nuser = "u"', ":2: no key mqtt.user; valid: username, password, password_file, ca, cert, key"),
        ("[mqtt]\npassword = 4711", ":2: mqtt.password is not text"),
        ('[mqtt]\npassword = "a"\npassword_file = "b"', ":3: mqtt.password_file: password is given, too"),
        ('[mqtt]\nkey = "a"', ":2: mqtt.key: cert is missing"),
        ('[mqtt]\nca = "\\u0000"', ":2: mqtt.ca is not text"),
    ],
)
def test_a_wrong_login_is_said_by_its_line_and_without_its_value(text: str, says: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        configuration.parse(text, "multidrop.toml")
    assert says in str(caught.value) and "4711" not in str(caught.value)


def test_config_show_hides_the_password_and_config_check_finds_a_missing_file(tmp_path: Path, multidrop: Any) -> None:
    (tmp_path / "conf").mkdir()
    (tmp_path / "conf" / "multidrop.toml").write_text('[mqtt]\nusername = "u"\npassword = "hunter2"\nca = "gone.pem"\n')
    shown, checked = multidrop("config", "show"), multidrop("config", "check")
    assert 'username = "u"\npassword = "***"\n' in shown.stdout and "hunter2" not in shown.stdout + shown.stderr
    assert checked.returncode == 2 and ":4: mqtt.ca: " in checked.stderr and "gone.pem" in checked.stderr


def test_a_program_that_a_stop_has_ended_is_published_as_ended_before_the_conditions_are_read_again() -> None:
    said: list[Any] = []
    drive = DriveValues(lambda what, axis, at, fields: said.append((at, fields)) if what == "state" else None, 1.0)
    drive.take(Sample(1.0, "a", 5, 0))
    drive.take(Conditioned(1.0, "a", (Conditions(program="G1", runs=True),)))
    drive.take(Sample(2.0, "a", 5, 0))
    drive.take(Sample(3.0, "a", 5, 0, program=False))
    rest = AT_REST
    assert said == [
        (1.0, {"value": rest}),
        (1.0, {"value": rest, "program": "G1"}),
        (3.0, {"value": rest, "program": ""}),
    ]


def test_each_axis_has_a_state_and_an_error_beside_those_of_its_drive() -> None:
    said: list[Any] = []

    def put(what: str, axis: str, at: float, fields: Any) -> None:
        if what in ("state", "error"):
            said.append((what, axis, fields["value"]))

    drive = DriveValues(put, 1.0)
    for axis, velocity in (("x", 0), ("y", 7)):
        drive.take(Sample(1.0, "00", 5, velocity, axis=axis))
    rest = [("state", "", AT_REST), ("state", "x", AT_REST)]
    assert said == [*rest, ("state", "", MOVING), ("state", "y", MOVING)]
    said.clear()
    drive.take(Conditioned(2.0, "00", (Conditions("x", disabled="EO=0"), Conditions("y", error=5))))
    assert ("state", "x", NO_CURRENT) in said and ("error", "", 5) in said and ("error", "x", 0) in said
    said.clear()
    drive.lost(3.0)
    drive.take(Conditioned(3.5, "00", (Conditions("x"), Conditions("y"))))
    states = [each for each in said if each[0] == "state" and each[2] != LOST]
    assert states == []
    drive.take(Sample(4.0, "00", 5, 0, axis="x"))
    assert said[-3:] == [("state", "", AT_REST), ("state", "x", AT_REST), ("state", "y", AT_REST)]


@given(st.text(alphabet="abz/@:?#&=%\\ '\"[]{},", max_size=12), st.text(alphabet="abz/@:?#&=% ", max_size=12))
def test_no_refusal_of_a_broker_quotes_its_password(before: str, after: str) -> None:
    for scheme in ("mqtt", "mqtts", "tcp"):
        url = f"{scheme}://me:{before}xyzzy{after}@10.0.0.5:503/proxy"
        with pytest.raises(Diagnostic) as refused:
            parse_target(url)
        assert "xyzzy" not in str(refused.value), url
