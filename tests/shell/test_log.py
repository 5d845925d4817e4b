import os
import re
from datetime import datetime

import pytest

from dialects import Diagnostic
from drives.events import Unsolicited
from shell.events import By, Entered, Failed, Notified, OnBus, Output, Printed, StateChanged
from shell.log import SessionLog


class FakeSession:
    def __init__(self):
        self.callbacks, self.told, self.log = [], [], None

    def subscribe(self, callback):
        self.callbacks.append(callback)
        return lambda: self.callbacks.remove(callback) if callback in self.callbacks else None

    def wall(self, at):
        return datetime.fromtimestamp(at).astimezone()

    def notify(self, text, warning=False):
        self.told.append((text, warning))

    def publish(self, *events):
        for event in events:
            for callback in list(self.callbacks):
                callback(event)


@pytest.fixture
def session():
    return FakeSession()


def test_everything_typed_printed_told_and_failed_is_a_line_at_once(session, tmp_path):
    path = tmp_path / "day.log"
    path.write_text("before\n")
    log = SessionLog(session, str(path))
    session.publish(
        Entered(1.0, "@b MR 100", By.OPERATOR, "press", "b"),
        Entered(1.0, "/drives", By.OPERATOR),
        Printed(1.0, "press", "b", "384112"),
        OnBus("press", Unsolicited(1.0, ("tick 1", "tick 2"))),
        Output(1.0, "* a"),
        Notified(1.0, "opened"),
        Failed(1.0, "b: 20", "press", "b"),
        StateChanged(1.0),
    )
    before, *lines = path.read_text().splitlines()
    assert before == "before"
    stamp = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3} "
    assert [line for line in lines if not re.match(stamp, line)] == []
    assert [line.split(" ", 1)[1] for line in lines] == [
        "> press:b MR 100",
        "> /drives",
        "< press:b 384112",
        "< press: tick 1",
        "< press: tick 2",
        "< * a",
        "* opened",
        "! b: 20",
    ]
    log.close()
    session.publish(Notified(1.0, "later"))
    log.close()
    assert "later" not in path.read_text()


def test_a_file_that_cannot_be_opened_is_named(session, tmp_path):
    with pytest.raises(Diagnostic, match=r"gone/day.log: cannot be written: No such file"):
        SessionLog(session, str(tmp_path / "gone" / "day.log"))


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
    assert "could not complete without blocking; the log is off now" in session.told[0][0]
    os.close(reader)


def test_a_file_that_vanished_ends_the_log_with_one_warning(session, tmp_path):
    session.log = SessionLog(session, str(tmp_path / "day.log"))
    (tmp_path / "day.log").unlink()
    session.publish(Notified(1.0, "first"), Notified(1.0, "second"))
    assert [("gone" in text, warning) for text, warning in session.told] == [(True, True)]


def test_a_line_that_a_full_disk_cut_off_is_not_joined_to_the_next(session, tmp_path):
    path = tmp_path / "day.log"
    path.write_text("2026-11-21T12:41:05.123 > a\n2026-11-21T12:4")
    session.log = SessionLog(session, str(path))
    session.publish(Notified(1.0, "first"), Notified(1.0, "second"))
    session.log.close()
    _, cut, first, second = path.read_text().splitlines()
    assert cut == "2026-11-21T12:4" and first.endswith("* first") and second.endswith("* second")


def test_a_log_has_no_passwords_and_no_control_characters(session, tmp_path):
    log = SessionLog(session, str(tmp_path / "day.log"))
    session.publish(
        Entered(1.0, "/open tcp://me:pw@gateway:503", By.OPERATOR),
        Failed(1.0, "tcp://me:pw@gateway:503: nothing listens there"),
        Printed(1.0, "press", "b", "\x1b]0;pw"),
        Printed(1.0, "press", "b", "P = 5 @ // b"),
    )
    log.close()
    text = (tmp_path / "day.log").read_text()
    assert "me:pw" not in text and text.count("tcp://***@gateway:503") == 2
    assert r"\x1b]0;pw" in text and "\x1b" not in text and "P = 5 @ // b" in text
