"""The gate of a shared screen: who gets in, stops ahead of everything, and watchers that do not behave."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import stat
import subprocess
import sys
import tempfile
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

import multidrop
from multidrop.base.errors import Diagnostic
from multidrop.features.shared_screen import host as host_side
from multidrop.features.shared_screen.host import MOST_WATCHERS, WAITING, Gate, GateCalls, Watcher
from multidrop.features.shared_screen.join import Stops, connect, joined
from multidrop.features.shared_screen.wire import Dropped, Item, Items, Now, StopHeard, greeting, line
from multidrop.transports import Unreachable
from tests.support.until import PATIENCE, until

pytestmark = pytest.mark.AF_UNIX


class Shared:
    """A gate whose calls are noted."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.ahead = 0
        self.stops: list[str] = []
        self.refused: list[str] = []
        self.left: list[str] = []
        self.behind: list[Watcher] = []
        calls = GateCalls(
            self._ahead, self.stops.append, self._joined, self.behind.append, self._left, self.refused.append
        )
        self.calls = calls
        self.gate = Gate(folder, asyncio.get_running_loop(), calls)

    def _ahead(self) -> None:
        self.ahead += 1

    def _joined(self, watcher: Watcher) -> None:
        self.gate.watchers.append(watcher)

    def _left(self, watcher: Watcher) -> None:
        self.left.append(watcher.name)
        if watcher in self.gate.watchers:
            self.gate.watchers.remove(watcher)


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder with a short path, as a socket needs it."""
    with tempfile.TemporaryDirectory(prefix="md") as made:
        yield Path(made) / "screens"


@pytest.fixture
async def shared(folder: Path) -> AsyncIterator[Shared]:
    made = Shared(folder)
    yield made
    made.gate.close()


def plain(shared: Shared, said: bytes) -> socket.socket:
    """A peer that says this."""
    made = socket.socket(socket.AF_UNIX)
    made.settimeout(PATIENCE)
    made.connect(str(shared.gate.path))
    with contextlib.suppress(BrokenPipeError):  # it hung up before
        made.sendall(said)
    return made


def to_end(made: socket.socket) -> bytes:
    """What is received until the end."""
    found = b""
    while True:
        try:
            data = made.recv(65536)
        except ConnectionResetError:  # it closed with bytes unread
            data = b""
        if not data:
            made.close()
            return found
        found += data


async def test_only_this_account_can_reach_the_socket(shared: Shared) -> None:
    assert stat.S_IMODE(shared.folder.stat().st_mode) == 0o700
    assert stat.S_IMODE(shared.gate.path.stat().st_mode) == 0o600
    assert shared.gate.path.name == f"{os.getpid()}.sock"
    shared.gate.close()
    assert not shared.gate.path.exists()


async def test_a_folder_that_is_a_link_or_too_long_is_refused_in_one_line(folder: Path) -> None:
    folder.symlink_to(folder.parent)
    with pytest.raises(Diagnostic, match="cannot share: the folder is another account's"):
        Shared(folder)
    with pytest.raises(Diagnostic, match="too long.*set MULTIDROP_STATE_DIR to a shorter path"):
        Shared(folder.parent / ("long" * 40))


async def test_another_account_gets_no_greeting(shared: Shared, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host_side, "peer", lambda made: os.getuid() + 1)
    peer = plain(shared, greeting() + b"\x18")
    assert await asyncio.to_thread(to_end, peer) == b""
    await until(lambda: shared.refused)
    assert (shared.refused, shared.ahead) == (["a watcher was refused: it is of another account"], 0)


async def test_a_stop_is_written_by_the_watchers_thread_while_the_loop_is_blocked(shared: Shared) -> None:
    peer = plain(shared, greeting())
    await until(lambda: shared.gate.watchers)
    assert peer.recv(200) == greeting()
    peer.sendall(b"\x18")
    assert peer.recv(200) == b'[["StopHeard","",[1]]]\n'  # this call blocks the loop
    assert (shared.ahead, shared.stops) == (1, [])
    await until(lambda: shared.stops)
    assert shared.stops == [shared.gate.watchers[0].name]
    peer.close()


async def test_the_loop_stops_where_the_thread_of_a_watcher_cannot_and_its_later_stops_are_taken(
    shared: Shared,
) -> None:
    def defective() -> None:
        raise ZeroDivisionError

    object.__setattr__(shared.calls, "stop_ahead", defective)
    peer = plain(shared, greeting())
    await until(lambda: shared.gate.watchers)
    peer.sendall(b"\x18")
    await until(lambda: len(shared.stops) == 1)
    peer.sendall(b"\x18")
    await until(lambda: len(shared.stops) == 2)
    peer.close()


HOSTILE = (
    b"GET / HTTP/1.1\r\n\r\n",
    b"\x18\x18\x18\n",
    b"\xff" * 5000,
    b"multidrop-screen " + b"a" * 5000,
)


async def test_what_is_no_watcher_is_hung_up_on_and_stops_nothing(shared: Shared) -> None:
    for said in HOSTILE:
        assert await asyncio.to_thread(to_end, plain(shared, said)) in (greeting(), b""), said
    peer = plain(shared, greeting() + b"MR 51200\r")
    assert (await asyncio.to_thread(to_end, peer)).startswith(greeting())
    await until(lambda: len(shared.left) == len(HOSTILE) + 1)
    assert (shared.ahead, shared.stops, shared.gate.watchers) == (0, [], [])


async def test_another_version_is_refused_on_both_sides_with_both_versions(
    shared: Shared, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = multidrop.__version__
    monkeypatch.setattr(multidrop, "__version__", "9.9")
    older = greeting()
    monkeypatch.setattr(multidrop, "__version__", own)
    peer = plain(shared, older)
    assert await asyncio.to_thread(to_end, peer) == greeting()
    await until(lambda: shared.refused)
    assert "is multidrop 9.9, this is " + own in shared.refused[0]
    theirs = SimpleNamespace(**vars(host_side.wire) | {"greeting": lambda: older})
    monkeypatch.setattr(host_side, "wire", theirs)
    with pytest.raises(Unreachable, match=f"the shared screen is multidrop 9.9, this is {own}; install one version"):
        await asyncio.to_thread(joined, "", shared.folder)


async def test_a_watcher_that_reads_nothing_costs_bounded_memory_and_is_told_what_was_dropped(shared: Shared) -> None:
    peer = plain(shared, greeting())
    await until(lambda: shared.gate.watchers)
    data = line([Item(Now(1.0))] * 1000)
    count = 4 * WAITING // len(data)
    for _ in range(count):
        shared.gate.watchers[0].put(data, 1000)
    assert peer.recv(len(greeting())) == greeting()
    items, parser = list[Item](), Items((Now, Dropped))

    def read() -> None:
        while not any(isinstance(each.value, Dropped) for each in items):
            items.extend(parser.take(peer.recv(65536)))

    await asyncio.to_thread(read)
    *kept, dropped = [each.value for each in items]
    assert len(kept) * 20 < 2 * WAITING and isinstance(dropped, Dropped)
    assert len(kept) + dropped.items == count * 1000
    await until(lambda: shared.behind)
    peer.close()
    await until(lambda: not shared.gate.watchers)


async def test_more_watchers_than_there_may_be_are_refused(shared: Shared) -> None:
    peers = [plain(shared, greeting()) for _ in range(MOST_WATCHERS)]
    await until(lambda: len(shared.gate.watchers) == MOST_WATCHERS)
    late = plain(shared, greeting())
    assert (await asyncio.to_thread(to_end, late)) == greeting()
    await until(lambda: shared.refused)
    assert shared.refused == [f"a watcher was refused: more than {MOST_WATCHERS} watchers at a time"]
    for each in peers:
        each.close()
    await until(lambda: len(shared.left) == MOST_WATCHERS + 1)


async def test_connections_that_never_greet_keep_no_watcher_out(shared: Shared) -> None:
    silent = [plain(shared, b"" if number % 2 else b"multidrop-scr") for number in range(3 * MOST_WATCHERS)]
    true = plain(shared, greeting())
    await until(lambda: shared.gate.watchers)
    more = [plain(shared, b"") for _ in range(2 * MOST_WATCHERS)]
    second = plain(shared, greeting())
    await until(lambda: len(shared.gate.watchers) == 2)
    true.sendall(b"\x18")
    await until(lambda: shared.stops)
    assert shared.ahead == 1 and shared.refused == []
    await until(lambda: len(shared.left) >= 4 * MOST_WATCHERS)  # the oldest were closed
    for each in (*silent, *more, true, second):
        each.close()


async def test_a_watcher_finds_the_only_screen_or_is_told_of_each(shared: Shared) -> None:
    connection, name, _ = await asyncio.to_thread(joined, "", shared.folder)
    assert "@" in name
    await until(lambda: shared.gate.watchers)
    stops = Stops(connection)
    stops.send()
    await until(lambda: shared.stops)
    assert (shared.ahead, stops.sent, stops.trouble) == (1, 1, "")
    connection.close(False)
    await until(lambda: shared.left)
    stops.send()
    assert stops.trouble

    second = socket.socket(socket.AF_UNIX)
    second.bind(str(shared.folder / "77.sock"))
    second.listen()
    own = str(os.getpid())
    with pytest.raises(Diagnostic, match=rf"2 screens are shared: .*{own} since \d\d:\d\d:\d\d.*--join \d+ joins"):
        connect("", shared.folder)
    with pytest.raises(Diagnostic, match=r"no screen 12 is shared: "):
        connect("12", shared.folder)
    connect("77", shared.folder).close()
    second.close()  # as after a kill: the file stays
    connect("", shared.folder).close()
    assert not (shared.folder / "77.sock").exists()


def test_nobody_shares(folder: Path) -> None:
    with pytest.raises(Unreachable, match="no screen is shared by this account on .*; `tui --share` shares one"):
        connect("", folder)


def test_what_is_no_screen_is_refused_in_one_line(folder: Path) -> None:
    for where in (
        "tcp://pc",
        "ssh://",
        "ssh://me:pw@pc",
        "ssh://pc/dev/ttyUSB0",
        "ssh://pc:x",
        "ssh://[",
        "ssh://pc?a=1",
        "ssh://-oProxyCommand=x",
        "ssh://-l@pc",
        "ssh://=cmd@pc",
    ):
        with pytest.raises(Diagnostic, match="is no screen to join; as in --join ssh://HOST") as caught:
            joined(where, folder)
        assert "pw" not in str(caught.value)


@pytest.mark.process
async def test_the_relay_passes_bytes_both_ways_until_either_end(shared: Shared) -> None:
    code = "import sys; from pathlib import Path; from multidrop.features.shared_screen.join import connect, splice; "
    code += "splice(connect('', Path(sys.argv[1])))"
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", code, str(shared.folder), stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdin and process.stdout
    async with asyncio.timeout(PATIENCE):
        assert await process.stdout.readline() == greeting()
        process.stdin.write(greeting() + b"\x18")
        assert Items((StopHeard,)).take(await process.stdout.readline()) == [Item(StopHeard(1))]
        process.stdin.close()
        assert await process.wait() == 0
    await until(lambda: shared.left)
    assert shared.ahead == 1
