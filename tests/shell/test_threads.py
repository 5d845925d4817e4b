"""The writer of a destination: one that hangs holds up no other, and what it has no room for is said in its place."""

from __future__ import annotations

import os
import threading

import pytest

from multidrop.shell.log.writer import Disk
from multidrop.shell.streams.output_streams import descriptor_writer
from multidrop.shell.threads import BoundedWriter
from tests.support.posix import pty
from tests.support.until import PATIENCE

DESTINATIONS = ("terminal", "pipe", "file", "log")
LINES = [b"%03d\n" % number for number in range(100)]


class Writers:
    """A writer for each destination. The system takes nothing for the one whose name is `held`, until `go`."""

    def __init__(self, folder, held, monkeypatch):
        self.go = threading.Event()
        master, slave = pty.openpty()
        reader, writer = os.pipe()
        self.ends = {"terminal": master, "pipe": reader}
        places = {"terminal": slave, "pipe": writer, "file": os.open(folder / "file", os.O_RDWR | os.O_CREAT)}
        self.descriptors = (master, slave, reader, *list(places.values())[1:])
        self.log = Disk(folder / "log", 10**6, 2, lambda: b"", lambda number: b"[%d]\n" % number)
        self.folder = folder
        self.writers = {
            name: descriptor_writer(each, lambda loss: b"[%d]\n" % loss.count, lambda problem: None, 200)
            for name, each in places.items()
        }
        inode = os.stat(folder / "log").st_ino if held == "log" else os.fstat(places[held]).st_ino
        write = os.write

        def gated(descriptor, data):
            if os.fstat(descriptor).st_ino == inode:
                self.go.wait(PATIENCE)
            return write(descriptor, data)

        monkeypatch.setattr(os, "write", gated)

    def put(self, line):
        self.log.put(line)
        return {name: each.put(line) for name, each in self.writers.items()}

    def taken(self, name, end):
        """What a destination took, up to an end."""
        got = b""
        while not got.endswith(end):
            got = got + os.read(self.ends[name], 1 << 16) if name in self.ends else (self.folder / name).read_bytes()
            got = got.replace(b"\r\n", b"\n")
        return got

    def close(self):
        self.go.set()
        self.log.close()
        for each in self.writers.values():
            each.close(PATIENCE)
        for each in self.descriptors:
            os.close(each)


@pytest.fixture
def made(tmp_path, monkeypatch):
    found = []

    def make(held):
        found.append(Writers(tmp_path, held, monkeypatch))
        return found[0]

    yield make
    found[0].close()


@pytest.mark.parametrize("held", DESTINATIONS)
def test_a_destination_that_hangs_holds_up_no_other(made, held):
    writers = made(held)
    others = [name for name in DESTINATIONS if name != held]
    for line in LINES:
        writers.put(line)
        for name, each in writers.writers.items():
            assert name == held or each.wait(PATIENCE)
    assert {name: writers.taken(name, LINES[-1]) for name in others} == dict.fromkeys(others, b"".join(LINES))
    assert held == "log" or not (writers.writers[held].idle or writers.writers[held].wait(0))
    writers.go.set()
    # The log has room for all of them.
    kept = LINES if held == "log" else [*LINES[:50], b"[50]\n"]
    assert writers.taken(held, kept[-1]) == b"".join(kept)


def test_a_writer_writes_the_rest_when_it_is_closed_and_then_takes_nothing_more():
    got, ended = [], []
    writer = BoundedWriter(lambda data: got.append(data) or len(data), lambda loss: b"", ended.append)
    assert writer.put(b"one") and writer.put(b"two")
    writer.close(PATIENCE)
    assert (b"".join(got), ended, writer.put(b"three"), writer.idle) == (b"onetwo", [None], False, True)


def test_a_problem_ends_a_writer_and_what_waits_for_it():
    def write(data):
        raise OSError(28, "No space left on device")

    ended = []
    writer = BoundedWriter(write, lambda loss: b"", ended.append)
    writer.put(b"one")
    assert writer.wait(PATIENCE) and writer.problem.errno == 28 and not writer.put(b"two")
    writer.close(PATIENCE)
    assert ended == [writer.problem]
