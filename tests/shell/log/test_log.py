"""The session log: its format, its writer, its file on the disk."""

import json
import os
import threading
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.dialects import Kind, Priority
from multidrop.drives.events import Ended, Sent, Traffic, Unsolicited
from multidrop.shell.configuration import LogSettings, Settings, parse
from multidrop.shell.events import By, Entered, Failed, Notified, OnBus, Output, Printed, StateChanged
from multidrop.shell.log import files, writer
from multidrop.shell.log.files import KINDS, TRAFFIC, LogEntry, entry_of, line_of
from multidrop.shell.log.writer import SessionLog, begin
from multidrop.shell.threads import BoundedWriter


class FakeSession:
    def __init__(self, folder, **limits):
        self.callbacks, self.told, self.log = [], [], None
        self.stops, self.stopped_at, self.buses, self.raw = 0, 1.0, {}, {}
        self.settings = Settings(
            {}, folder / "config", folder / "state", data=folder / "data", log=LogSettings(**limits)
        )

    def subscribe(self, callback):
        self.callbacks.append(callback)
        return lambda: self.callbacks.remove(callback) if callback in self.callbacks else None

    def now(self):
        return 1.0

    def wall(self, at):
        return datetime.fromtimestamp(at, UTC)

    def changed(self):
        pass

    def notify(self, text, warning=False):
        self.told.append((text, warning))

    def publish(self, *events):
        for event in events:
            for callback in list(self.callbacks):
                callback(event)


@pytest.fixture
def session(tmp_path):
    return FakeSession(tmp_path)


def read(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def without_time(path):
    return [{key: value for key, value in each.items() if key != "time"} for each in read(path)]


def request(text, priority=Priority.OPERATOR, kind=Kind.PRINT, address="b"):
    return SimpleNamespace(address=address, text=text, priority=priority, kind=kind)


def test_everything_typed_printed_told_and_failed_is_a_line_at_once(session, tmp_path):
    path = tmp_path / "day.log"
    log = SessionLog(session, path)
    session.publish(
        Entered(1.5, "@b MR 100", By.OPERATOR, "press", "b"),
        Entered(1.5, "/drives", By.MACRO),
        Printed(1.5, "press", "b", "384112"),
        OnBus("press", Unsolicited(1.5, ("tick 1", "tick 2"))),
        Output(1.5, "* a"),
        Notified(1.5, "opened", warning=True),
        Failed(1.5, "b: 20", "press", "b"),
        StateChanged(1.5),
    )
    head, *lines = without_time(path)
    assert head["kind"] == "log" and head["format"] == 1
    assert lines == [
        {"kind": "typed", "bus": "press", "drive": "b", "text": "@b MR 100", "by": "operator"},
        {"kind": "typed", "text": "/drives", "by": "macro"},
        {"kind": "printed", "bus": "press", "drive": "b", "text": "384112"},
        {"kind": "unsolicited", "bus": "press", "text": "tick 1"},
        {"kind": "unsolicited", "bus": "press", "text": "tick 2"},
        {"kind": "output", "text": "* a"},
        {"kind": "notice", "text": "opened", "warning": True},
        {"kind": "failed", "bus": "press", "drive": "b", "text": "b: 20"},
    ]
    assert read(path)[-1]["time"] == "1970-01-01T00:00:01.500000+00:00"
    log.close()
    session.publish(Notified(1.0, "later"))
    log.close()
    assert "later" not in path.read_text()


def test_bytes_have_their_bus_and_the_drive_of_their_request_and_polls_are_marked(session, tmp_path):
    SessionLog(session, tmp_path / "day.log")
    typed, poll = request("PR P"), request("PR V", Priority.POLL)
    for each, out, back in ((typed, b"bPR P\n", b"5\r\n"), (poll, b"bPR V\n", b"\xff")):
        session.publish(
            OnBus("press", Sent(1.0, each)),
            OnBus("press", Traffic(1.0, True, out)),
            OnBus("eth", Traffic(1.0, False, b"other")),
            OnBus("press", Traffic(1.0, False, back)),
            OnBus("press", Ended(1.0, None)),
        )
    session.publish(OnBus("press", Traffic(1.0, True, b"\x1b")), OnBus("press", Traffic(1.0, False, b">")))
    seen = [
        (e["kind"], e["bus"], e.get("drive"), e["bytes"], e.get("poll")) for e in without_time(tmp_path / "day.log")[1:]
    ]
    other = ("received", "eth", None, "other", None)
    assert seen == [
        ("sent", "press", "b", "bPR P\n", None),
        other,
        ("received", "press", "b", "5\r\n", None),
        ("sent", "press", "b", "bPR V\n", True),
        other,
        ("received", "press", "b", "\xff", True),
        ("sent", "press", None, "\x1b", None),
        ("received", "press", None, ">", None),
    ]


def test_bytes_after_a_request_that_did_not_leave_are_of_no_drive(session, tmp_path):
    SessionLog(session, tmp_path / "day.log")
    session.publish(OnBus("press", Sent(1.0, request("PR P"))), OnBus("press", Ended(1.0, None)))
    session.publish(OnBus("press", Traffic(1.0, True, b"\x1b")), OnBus("press", Traffic(1.0, False, b">")))
    assert [each.get("drive") for each in without_time(tmp_path / "day.log")[1:]] == [None, None]


def test_commands_and_stops_are_marked_and_a_stop_is_before_its_bytes(session, tmp_path):
    SessionLog(session, tmp_path / "day.log")
    for each in (
        request("MR 5", kind=Kind.COMMAND),
        request("EM=1", kind=Kind.SETTING),
        request("SL 0", kind=Kind.QUIET, address="*"),
        request("PR P"),
        request("MR 6", kind=Kind.PROGRAM),
        request("AR", Priority.POLL, kind=Kind.COMMAND),
    ):
        session.publish(OnBus("l", Sent(1.0, each)), OnBus("l", Traffic(1.0, True, b"x")))
    session.publish(OnBus("l", Traffic(1.0, False, b"y")))
    session.stops, session.stopped_at = 1, 1.5
    session.publish(OnBus("l", Traffic(2.0, True, b"\x1b", stop=True)))
    head, *found = read(tmp_path / "day.log")
    assert head["marks"] is True
    assert [each.get("command") for each in found] == ["MR 5", "EM=1", "SL 0", *[None] * 6]
    assert [each["kind"] for each in found[-2:]] == ["stop", "sent"]
    assert [each.get("stop") for each in found] == [*[None] * 8, True]
    assert found[-2]["time"].endswith(":01.500000+00:00")
    assert entry_of(json.dumps(found[0]).encode()).command == "MR 5"


def test_a_stop_and_buses_that_come_and_go_are_entries(session, tmp_path):
    SessionLog(session, tmp_path / "day.log")
    bus = SimpleNamespace(link=SimpleNamespace(transport=SimpleNamespace(name="/dev/ttyS0")), drives={})
    session.buses["press"] = bus
    session.publish(StateChanged(1.0), StateChanged(1.0))
    bus.drives["a"] = SimpleNamespace(product="LMDCM", version="6.002")
    session.stops = 1
    session.publish(StateChanged(1.0), Notified(1.0, "Ctrl+X: stop sent"), Notified(1.0, "more"))
    session.buses.clear()
    session.publish(StateChanged(1.0))
    found = [(each["kind"], each["text"]) for each in read(tmp_path / "day.log")[1:]]
    assert found == [
        ("bus", "/dev/ttyS0: no drive yet"),
        ("stop", "stop of every drive"),
        ("bus", "/dev/ttyS0: a LMDCM 6.002"),
        ("notice", "Ctrl+X: stop sent"),
        ("notice", "more"),
        ("bus", "closed"),
    ]


AT = st.datetimes(timezones=st.just(UTC)) | st.datetimes().map(
    lambda at: at.astimezone(UTC) if 1971 < at.year < 3000 else datetime.now(UTC)
)
BYTES = st.binary(max_size=30).map(lambda data: data.decode("latin-1"))


@given(st.builds(LogEntry, AT, st.sampled_from(TRAFFIC), BYTES, st.text(max_size=5), poll=st.booleans()))
def test_any_bytes_are_read_back_as_they_were(entry):
    line = line_of(entry)
    if "***" not in line.decode():
        assert entry_of(line) == entry and line.count(b"\n") == 1 and line.isascii()


@given(st.binary(max_size=80) | st.sampled_from([*KINDS]).map(lambda kind: json.dumps({"kind": kind}).encode()))
def test_a_line_that_is_none_is_no_entry_and_no_crash(line):
    assert entry_of(line) is None


@pytest.mark.parametrize(
    "change",
    [
        {"time": "yesterday"},
        {"time": "2026-11-22T12:00:00"},
        {"time": 5},
        {"kind": "sung"},
        {"kind": []},
        {"format": 2},
        {"text": 5},
        {"bus": None},
    ],
    ids=str,
)
def test_a_line_of_another_format_is_no_entry(change):
    good = {"time": "2026-11-22T12:00:00+01:00", "kind": "notice", "text": "x"}
    assert entry_of(json.dumps(good).encode()) is not None
    assert entry_of(json.dumps(good | change).encode()) is None


def test_a_log_has_no_passwords_and_no_control_characters(session, tmp_path):
    SessionLog(session, tmp_path / "day.log")
    session.publish(
        Entered(1.0, "/open tcp://me:pw@gateway:503", By.OPERATOR),
        Failed(1.0, "tcp://me:pw@gateway:503: nothing listens there"),
        OnBus("line", Traffic(1.0, True, b"password = pw\r")),
        Printed(1.0, "press", "b", "\x1b]0;"),
    )
    text = (tmp_path / "day.log").read_text()
    assert "pw" not in text and text.count("tcp://***@gateway:503") == 2
    assert "\x1b" not in text and read(tmp_path / "day.log")[-1]["text"] == "\x1b]0;"


def test_a_file_that_cannot_be_opened_is_named(session, tmp_path):
    with pytest.raises(Diagnostic, match=r"gone[/\\]day.log: cannot be written: No such file"):
        SessionLog(session, str(tmp_path / "gone" / "day.log"))


@pytest.mark.fork
def test_a_full_disk_ends_the_log_with_one_warning(session):
    session.log = SessionLog(session, "/dev/full")
    session.publish(Notified(1.0, "first"), Notified(1.0, "second"))
    assert session.told == [("log /dev/full: No space left on device; the log is off now", True)]
    assert session.log is None and session.callbacks == []


def test_a_pipe_that_nobody_reads_is_never_waited_for(session, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(Diagnostic, match="pipe: cannot be written"):
        SessionLog(session, str(tmp_path / "pipe"))
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    session.log = SessionLog(session, str(tmp_path / "pipe"))
    session.publish(*[Notified(1.0, "x" * 1000)] * 100)
    assert session.log is None and [warning for _, warning in session.told] == [True]
    assert "its reader does not take it; the log is off now" in session.told[0][0]
    os.close(reader)


@pytest.mark.fork
def test_a_file_that_vanished_ends_the_log_with_one_warning(session, tmp_path):
    session.log = SessionLog(session, tmp_path / "day.log")
    (tmp_path / "day.log").unlink()
    session.publish(Notified(1.0, "first"), Notified(1.0, "second"))
    assert [("gone" in text, warning) for text, warning in session.told] == [(True, True)]


def test_a_line_that_a_full_disk_cut_off_is_not_joined_to_the_next(session, tmp_path):
    path = tmp_path / "day.log"
    path.write_text('{"time": "2026')
    SessionLog(session, path).close()
    cut, head = path.read_bytes().splitlines()
    assert cut == b'{"time": "2026' and entry_of(head).kind == "log"


def test_a_full_part_is_rotated_and_the_oldest_one_goes(tmp_path):
    session = FakeSession(tmp_path, size=1000, files=3)
    path = tmp_path / "day.log"
    SessionLog(session, path)
    session.publish(*(Notified(1.0, f"entry {number}") for number in range(100)))
    parts = files.parts(path)
    assert [each.name for each in parts] == ["day.log.2", "day.log.1", "day.log"]
    assert all(each.stat().st_size <= 1000 for each in parts)
    assert [next(files.lines(each)).entry.kind for each in parts] == ["log"] * 3
    texts = [line.entry.text for each in parts for line in files.lines(each) if line.entry.kind == "notice"]
    assert texts == [f"entry {number}" for number in range(100 - len(texts), 100)]


def test_two_sessions_that_write_one_file_follow_each_others_rotation(tmp_path):
    path = tmp_path / "day.log"
    sessions = [FakeSession(tmp_path, size=2000, files=50) for _ in range(2)]
    for each in sessions:
        SessionLog(each, path)
    for number in range(40):
        for each in sessions:
            each.publish(Notified(1.0, f"entry {number}"))
    texts = [line.entry.text for each in files.parts(path) for line in files.lines(each) if line.entry.kind == "notice"]
    assert texts == [f"entry {number}" for number in range(40) for _ in range(2)]


def test_a_disk_that_hangs_is_waited_for_once_and_what_has_no_room_is_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "MOST_HELD_BYTES", 100)
    monkeypatch.setattr(writer, "WRITE_TIMEOUT", 60.0)
    made = writer.Disk(tmp_path / "a", 10**6, 2, lambda: b"head\n", lambda number: b"%d missing\n" % number)
    made.put(b"first\n")
    monkeypatch.setattr(writer, "WRITE_TIMEOUT", 0.001)
    works, waits, write, wait = threading.Event(), [], os.write, BoundedWriter.wait
    monkeypatch.setattr(writer.os, "write", lambda *given: works.wait(60) and write(*given))
    monkeypatch.setattr(BoundedWriter, "wait", lambda *given: waits.append(given) or wait(*given))
    for number in range(30):
        made.put(b"%09d\n" % number)
    made.put(b"three\nentries\nof one event\n", 3)
    assert len(waits) == 1
    works.set()
    made.close()
    lines = (tmp_path / "a").read_text().split("\n")
    assert lines[:3] == ["head", "first", "000000000"] and lines[-2:] == ["23 missing", ""] and len(lines) == 14


def test_a_session_has_a_log_of_its_own_where_the_configuration_says_so(tmp_path):
    session = FakeSession(tmp_path)
    begin(session)
    assert session.log is None
    session = FakeSession(tmp_path, always=True)
    begin(session)
    assert session.log.path.parent == tmp_path / "state" / "logs" and files.newest(session.settings) == session.log.path
    session.settings.state.joinpath("logs").rename(tmp_path / "moved")
    session.settings.state.joinpath("logs").write_text("a file")
    begin(session)
    assert len(session.told) == 1 and "this session has no log" in session.told[0][0]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("log = 5", "log is not a table"),
        ("[log]\nsize = 5", "no key log.size"),
        ("[log]\nalways = 1", "log.always is not true or false"),
        ("[log]\nmegabytes = 0", "log.megabytes is not a number from 0.01 to 10000"),
        ("[log]\nmegabytes = true", "log.megabytes is not a number"),
        ("[log]\nfiles = 1.5", "log.files is not a whole number"),
        ("[log]\nfiles = 0", "log.files is not a number from 1 to 1000"),
    ],
)
def test_a_wrong_setting_is_named(text, problem):
    with pytest.raises(Diagnostic, match=rf"multidrop.toml:\d+: {problem}"):
        parse(text, "multidrop.toml")


def test_the_settings_of_the_log_are_read():
    assert parse("[log]\nalways = true\nmegabytes = 0.5\nfiles = 2", "x").log == LogSettings(True, 500_000, 2)
    assert parse("", "x").log == LogSettings()


def test_the_oldest_logs_of_the_folder_give_way(tmp_path):
    settings = FakeSession(tmp_path, size=100, files=2).settings
    for number in range(5):
        path = files.fresh(settings).with_name(f"{number}.jsonl")
        path.write_bytes(b"x" * 60)
        os.utime(path, (number, number))
    files.fresh(settings)
    assert sorted(each.name for each in files.folder(settings).iterdir()) == ["2.jsonl", "3.jsonl", "4.jsonl"]


def test_the_newest_log_is_found_wherever_it_is(session, tmp_path):
    with pytest.raises(Diagnostic, match=r"no session log yet.*/log FILE begins one"):
        files.newest(session.settings)
    for number, name in enumerate(("new.log", "old.log")):
        SessionLog(session, tmp_path / name).close()
        os.utime(tmp_path / name, (9 - number, 9 - number))
    assert files.newest(session.settings) == tmp_path / "new.log"


def test_times_of_the_log_are_those_of_the_events(session, tmp_path):
    SessionLog(session, tmp_path / "day.log")
    session.publish(Notified(1.25, "x"), Notified(2.5, "y"))
    first, second = [line.entry.time for line in files.lines(tmp_path / "day.log")][1:]
    assert second - first == timedelta(seconds=1.25)
