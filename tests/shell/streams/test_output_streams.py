"""Writers and outlets on pipes of the test's own: order, bounds, words for what is missing, readers that go away."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import json
import os
import re
import select
import sys
import threading
from datetime import datetime

import pytest

from multidrop.shell import threads
from multidrop.shell.streams import output_streams, stdout
from multidrop.shell.streams.output_streams import descriptor_writer
from tests.support.posix import fcntl, pty
from tests.support.served_cell import until
from tests.support.until import PATIENCE


class Pipe:
    """A writer into a pipe that nobody reads yet. It holds back no byte less than the pipe and the limit."""

    def __init__(self, limit=10_000):
        self.reader, self.writer = os.pipe()
        self.problems, self.failed = [], threading.Event()
        self.out = descriptor_writer(self.writer, lambda loss: f"[{loss.count}]".encode(), self._failed, limit)

    def _failed(self, problem):
        self.problems.append(problem.errno)
        self.failed.set()

    def read(self, until):
        got = b""
        while until not in got:
            got += os.read(self.reader, 65536)
        return got

    def fill(self, kilobytes):
        """Put so many lines of 1000 bytes; the pipe takes 64 of them at most, less where its user has many pipes."""
        for _ in range(kilobytes):
            assert self.out.put(b"x" * 999 + b"\n", keep=True)
        if sys.platform != "win32":  # where a write into a full pipe waits for all of it
            room = fcntl.fcntl(self.writer, fcntl.F_GETPIPE_SZ) if sys.platform == "linux" else 16_384
            until(lambda: self.out.written >= room // 2, "the pipe never filled")

    def close(self):
        self.out.give_up()
        for descriptor in (self.reader, self.writer):
            os.close(descriptor)


@pytest.fixture
def pipe():
    made = Pipe()
    yield made
    made.close()


def test_items_leave_in_their_order(pipe):
    for number in range(1000):
        assert pipe.out.put(b"%d " % number)
    assert pipe.read(b"999 ") == b"".join(b"%d " % number for number in range(1000))


def test_what_does_not_fit_is_dropped_and_told_in_its_place(pipe):
    pipe.fill(100)
    assert pipe.out.behind and not pipe.out.idle
    assert [pipe.out.put(b"lost\n") for _ in range(5)] == [False] * 5
    assert not pipe.out.put(b"three\nlines\nmore\n", count=3)
    assert pipe.out.put(b"kept\n", keep=True)
    got = pipe.read(b"kept\n")
    assert got.endswith(b"x\n[8]kept\n") and got.count(b"\n") == 101
    assert pipe.out.put(b"more\n")
    assert pipe.read(b"more\n") == b"more\n"


@pytest.mark.fork
def test_a_reader_that_goes_away_is_told_once_and_nothing_is_waited_for(pipe):
    os.close(pipe.reader)
    pipe.out.put(b"one\n")
    assert pipe.failed.wait(PATIENCE)
    assert not pipe.out.put(b"two\n", keep=True)
    assert (pipe.problems, pipe.out.idle, pipe.out.behind) == ([errno.EPIPE], True, False)
    pipe.reader = os.dup(pipe.writer)


@pytest.mark.fork
def test_a_descriptor_that_somebody_else_made_non_blocking_loses_nothing(pipe):
    os.set_blocking(pipe.writer, False)
    for number in range(200):
        assert pipe.out.put(b"%06d" % number + b"x" * 993 + b"\n", keep=True)
    got = pipe.read(b"000199")
    assert [line[:6] for line in got.split(b"\n")[:200]] == [b"%06d" % number for number in range(200)]


@contextlib.contextmanager
def streams(monkeypatch):
    """Standard output and standard error as pipes: the streams, and the readers' ends."""
    pipes = [os.pipe(), os.pipe()]
    files = [os.fdopen(writer, "w", encoding="utf-8") for _, writer in pipes]
    monkeypatch.setattr(sys, "stdout", files[0])
    monkeypatch.setattr(sys, "stderr", files[1])
    monkeypatch.setattr(stdout, "dropped", [])
    with stdout.nonblocking() as made:
        yield made, *(reader for reader, _ in pipes)
    for each in made.outlets:
        each.writer.give_up()
    for file in files:
        file.close()
    for reader, _ in pipes:
        os.close(reader)


def taken(reader):
    """What there is to read."""
    got = b""
    while select.select([reader], [], [], 0)[0]:
        got += os.read(reader, 65536)
    return got


def test_two_pipes_are_two_destinations(monkeypatch):
    ends = [os.pipe(), os.pipe()]
    pipes = [os.fdopen(writer, "w") for _, writer in ends]
    monkeypatch.setattr("sys.stdout", pipes[0])
    monkeypatch.setattr("sys.stderr", pipes[1])
    with output_streams.outlets(lambda stream, problem: None) as made:
        print("a reply")
        print("a warning", file=sys.stderr)
        asyncio.run(made.finish(lambda: False))
    for pipe in pipes:
        pipe.close()
    said = [os.read(reader, 100) for reader, _ in ends]
    for reader, _ in ends:
        os.close(reader)
    assert said == [b"a reply\n", b"a warning\n"]


def test_the_standard_streams_are_replaced_and_put_back(monkeypatch):
    reader, writer = os.pipe()
    with os.fdopen(writer, "w") as file:
        monkeypatch.setattr(sys, "stdout", file)
        monkeypatch.setattr(sys, "stderr", file)
        with stdout.nonblocking() as streams:
            assert len({each.writer for each in streams.outlets}) == 1, "one place, one order"
            print("half a ", end="")
            print("line")
            stdout.write(sys.stderr, "told")
            print("the rest", end="")
        assert sys.stdout is file and sys.stderr is file
        got = b""
        while not got.endswith(b"the rest"):
            got += os.read(reader, 1000)
        assert got == b"half a line\ntold\nthe rest"
    os.close(reader)


async def test_a_terminal_that_is_not_read_loses_replies_and_no_warning(monkeypatch):
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as terminal, os.fdopen(os.dup(slave), "w") as errors:
        monkeypatch.setattr(sys, "stdout", terminal)
        monkeypatch.setattr(sys, "stderr", errors)
        with stdout.nonblocking() as made:
            for _ in range(500):
                stdout.write(sys.stdout, "x" * 999)
            assert made.outlets[0].writer.behind
            stdout.write(sys.stderr, "STILL MOVING")
            got = b""
            async with asyncio.timeout(PATIENCE):
                await made.ready()  # a terminal is not waited for
                while b"the terminal did not take them\r\n" not in got:
                    got += taken(master)
                    await asyncio.sleep(0.001)
        lost = int(got.partition(b" lines are missing here")[0].rpartition(b"\n")[2])
        assert b"STILL MOVING\r\n" in got and got.count(b"x" * 999) == 500 - lost
    os.close(master)


@pytest.mark.fork
async def test_automation_waits_while_a_pipe_is_behind_and_no_reply_is_dropped(monkeypatch):
    with streams(monkeypatch) as (made, reader, _):
        lines, got = 200, b""
        for _ in range(lines):
            stdout.write(sys.stdout, "x" * 999)
        waiting = asyncio.create_task(made.ready())
        await asyncio.sleep(0.05)
        assert not waiting.done()
        async with asyncio.timeout(PATIENCE):
            while got.count(b"\n") < lines:
                got += taken(reader)
                await asyncio.sleep(0.001)
            await waiting
        assert got == (b"x" * 999 + b"\n") * lines


async def test_a_file_loses_nothing_that_nobody_asked_for(monkeypatch, tmp_path):
    with open(tmp_path / "kept.txt", "w") as file, monkeypatch.context() as replaced:
        replaced.setattr(sys, "stdout", file)
        with stdout.nonblocking() as made:
            for number in range(5000):
                stdout.write(sys.stdout, f"{number:0999}", spare=True)
            async with asyncio.timeout(PATIENCE):
                assert await made.finish(lambda: False) == []
    kept = (tmp_path / "kept.txt").read_text().splitlines()
    assert [int(line) for line in kept] == list(range(5000))


@pytest.mark.fork
async def test_a_disk_that_hangs_loses_what_is_over_the_bound_and_it_is_told(monkeypatch):
    monkeypatch.setattr(threads, "MOST_HELD_BYTES", 300_000)
    monkeypatch.setattr(output_streams.stat, "S_ISREG", lambda mode: True)  # a pipe that takes 64 kB and then nothing
    with streams(monkeypatch) as (made, reader, errors):
        for _ in range(1000):
            stdout.write(sys.stdout, "x" * 999, spare=True)
        assert made.outlets[1].writer.behind, "a script waits"
        got, told, lost = b"", b"", 0
        async with asyncio.timeout(PATIENCE):
            while not lost or got.count(b"\n") < 1000 - lost:
                got, told = got + taken(reader), told + taken(errors)
                lost = sum(int(line.split()[0]) for line in told.splitlines())
                await asyncio.sleep(0.001)
        assert 300 <= got.count(b"\n") < 700


@pytest.mark.fork
async def test_a_loss_is_an_object_at_its_place_in_a_stream_of_objects(monkeypatch):
    monkeypatch.setattr(output_streams, "as_json", True)
    with streams(monkeypatch) as (_, reader, errors):
        for number in range(500):
            stdout.write(sys.stdout, json.dumps({"number": number, "text": "x" * 999}), spare=True)
        stdout.write(sys.stdout, '{"number": 500}')
        got = b""
        async with asyncio.timeout(PATIENCE):
            while b'"number": 500' not in got:
                got += taken(reader)
                await asyncio.sleep(0.001)
        *objects, loss, last = map(json.loads, got.splitlines())
        assert [each["number"] for each in objects] == list(range(500 - loss["lost"])) and last == {"number": 500}
        since, until = (datetime.fromisoformat(loss[name]) for name in ("from", "to"))
        assert list(loss) == ["lost", "from", "to"] and since <= until and since.tzinfo is not None
        told = b""  # a thread of its own writes each stream
        async with asyncio.timeout(PATIENCE):
            while not told.endswith(b"\n"):
                told += taken(errors)
                await asyncio.sleep(0.001)
        assert told.decode().startswith(f"{loss['lost']} lines lost, ")


@pytest.mark.fork
async def test_what_nobody_asked_for_is_dropped_and_told_on_standard_error(monkeypatch):
    with streams(monkeypatch) as (_, reader, errors):
        for _ in range(500):
            stdout.write(sys.stdout, "x" * 999, spare=True)
        got, told, missing = b"", "", 0
        async with asyncio.timeout(PATIENCE):
            while got.count(b"\n") < 500 - missing:
                got += taken(reader)
                told += taken(errors).decode()  # one notice for each time that there was no room
                missing = sum(int(line.split()[0]) for line in told.splitlines())
                await asyncio.sleep(0.001)
        assert missing
        for line in told.splitlines():
            times = r"\d\d:\d\d:\d\d\.\d{3}"
            assert re.fullmatch(rf"(1 line|\d+ lines) lost, {times} to {times}: the output is not read", line)


@pytest.mark.fork
@pytest.mark.parametrize(("hurried", "told"), [(False, 1), (True, 0)])
async def test_a_reader_that_takes_nothing_is_given_up_at_the_end(monkeypatch, hurried, told):
    monkeypatch.setattr(output_streams, "PIPE_TIMEOUT", 0.05)
    monkeypatch.setattr(output_streams, "SHORT_TIMEOUT", 0.05)
    with streams(monkeypatch) as (made, _, _):
        for _ in range(100):
            stdout.write(sys.stdout, "x" * 999)
        async with asyncio.timeout(PATIENCE):
            await stdout.finish(made, lambda: hurried)
        assert len(stdout.dropped) == told
        assert os.fstat(sys.stdout.fileno()).st_rdev == os.stat(os.devnull).st_rdev


@pytest.mark.fork
async def test_a_full_disk_is_told_at_the_end(monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        monkeypatch.setattr(stdout, "dropped", [])
        with stdout.nonblocking() as made:
            stdout.write(sys.stdout, "line")
            async with asyncio.timeout(PATIENCE):
                await stdout.finish(made, lambda: False)
        assert stdout.dropped == ["the output cannot be written: No space left on device"]
