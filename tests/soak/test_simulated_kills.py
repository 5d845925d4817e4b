"""A process that is killed in the simulation: nothing of it takes effect any more; and the disk that it leaves."""

from __future__ import annotations

import asyncio
import gc
import os
from collections.abc import Awaitable, Callable, Iterator
from contextlib import ExitStack
from datetime import datetime
from functools import partial
from pathlib import Path
from random import Random

import pytest

from multidrop.base.atomic import create_atomically, make_folder, write_atomically
from multidrop.base.store import Store
from multidrop.shell import threads
from multidrop.shell.configuration import Settings
from multidrop.shell.log import files
from multidrop.shell.prompt.line_queue import History
from multidrop.shell.state.backups import write_backup
from soak.simulation.records.climate import Climate
from soak.simulation.system.clock import SimulatedLoop
from soak.simulation.system.disk import Disk
from soak.simulation.system.process import Killed, Process, operate
from soak.simulation.system.threads import Scheduler
from soak.simulation.system.wall import Wall

CALM = Climate(1)


class Bench:
    """A PC with one process: a loop, a disk, threads, and a wire that takes what is written."""

    def __init__(self, folder: Path, climate: Climate = CALM) -> None:
        self.folder = folder
        self.loop = SimulatedLoop(Random(1))
        self.scheduler = Scheduler(self.loop, Random(2))
        self.operations: list[str] = []
        noted = lambda what, path: self.operations.append(what)  # noqa: E731
        self.disk = Disk(f"{folder}/", self.loop, Wall(self.loop), climate, Random(3), noted)
        self.wire = bytearray()
        self.process = self.born()

    def born(self) -> Process:
        """Start a process."""
        process = Process(7, self.loop)
        process.at_death += (lambda: self.disk.close_all(process), lambda: self.scheduler.forget(process))
        return process

    def write(self, data: bytes) -> None:
        """Write to the wire, as a port of the process."""
        operate(lambda: self.wire.extend(data))

    def live(self, work: Callable[[], Awaitable[object]], seconds: float = 100.0) -> None:
        """Let the process work for a while."""

        async def life() -> None:
            self.process.start(work())
            await asyncio.sleep(seconds)

        with ExitStack() as stack:
            stack.enter_context(self.disk.installed())
            stack.enter_context(self.scheduler.installed())
            self.loop.run_until_complete(life())


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Callable[..., Bench]]:
    made: list[Bench] = []

    def new(climate: Climate = CALM) -> Bench:
        folder = tmp_path / f"pc-{len(made)}"
        folder.mkdir()
        made.append(Bench(folder, climate))
        return made[-1]

    yield new
    for each in made:
        each.loop.close()


@pytest.fixture
def bench(make: Callable[..., Bench]) -> Bench:
    return make()


def test_nothing_of_a_dead_process_takes_effect(bench: Bench) -> None:
    """A `finally` writes to the wire and to the disk; a task, a thread and a timer are planted."""

    async def cleans_up() -> None:
        try:
            await asyncio.sleep(1000)
        finally:
            asyncio.get_running_loop().call_later(1, bench.write, b"planned by a finally")
            asyncio.get_running_loop().create_task(later())
            for effect in (lambda: bench.write(b"finally"), lambda: (bench.folder / "finally").touch()):
                try:
                    effect()
                except BaseException:
                    await asyncio.sleep(0)

    async def later() -> None:
        await asyncio.sleep(0.5)
        bench.write(b"task")

    async def work() -> None:
        loop = asyncio.get_running_loop()
        writer = threads.BoundedWriter(os_write, lambda loss: b"", lambda problem: bench.write(b"ended"))
        (bench.folder / "before").write_text("whole")
        kept.append(loop.create_task(cleans_up()))
        kept.append(loop.create_task(later()))
        loop.call_later(1, bench.write, b"timer")
        await asyncio.sleep(0)
        loop.add_reader(5, bench.write, b"reader")
        writer.put(b"thread")
        loop.run_in_executor(None, bench.write, b"executor")
        bench.process.arm(1, "after")
        bench.write(b"the last")

    def os_write(data: bytes) -> int:
        bench.write(data)
        return len(data)

    kept: list[asyncio.Task[None]] = []
    bench.live(work)
    bench.loop.readable(5)
    assert bench.wire == b"the last" and [each.name for each in bench.folder.iterdir()] == ["before"]
    assert bench.process.dead and not bench.scheduler.running and not bench.loop.defects
    assert not asyncio.all_tasks(bench.loop)


def test_a_failure_that_a_dead_process_cannot_take_is_no_defect(bench: Bench) -> None:
    """One that a live process does not take is a defect; the garbage collection tells of both."""

    async def fails(dies: bool) -> None:
        asyncio.get_running_loop().create_future().set_exception(ValueError(f"{dies}"))
        if dies:
            kept.append(asyncio.get_running_loop().create_future())
            kept[0].set_exception(ValueError("dead"))
            bench.process.die()

    kept: list[asyncio.Future[None]] = []
    for dies in (False, True):
        bench.live(partial(fails, dies), 1.0)
    kept.clear()
    gc.collect()
    assert [str(each["exception"]) for each in bench.loop.defects] == ["False", "True"]


@pytest.mark.parametrize(("moment", "written"), [("before", b""), ("after", b"abcdef")])
def test_a_kill_is_before_or_after_an_operation(bench: Bench, moment: str, written: bytes) -> None:
    async def work() -> None:
        bench.process.arm(1, moment)
        bench.write(b"abcdef")

    bench.live(work)
    assert bench.wire == written


def test_a_kill_tears_a_write_at_any_byte(make: Callable[..., Bench]) -> None:
    found = set()
    for seed in range(40):
        bench = make()
        bench.disk.rng = Random(seed)

        async def work(bench: Bench = bench) -> None:
            bench.process.arm(2, "within")
            (bench.folder / "torn").write_bytes(b"abc")

        bench.live(work)
        found.add((bench.folder / "torn").read_bytes())
    assert found == {b"", b"a", b"ab", b"abc"}


def test_a_dead_process_gives_back_its_files_and_locks(bench: Bench) -> None:
    fcntl = pytest.importorskip("fcntl")
    locked: list[bool] = []

    async def holds() -> None:
        fd = os.open(bench.folder / "lock", os.O_RDWR | os.O_CREAT)
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        bench.process.die()
        with pytest.raises(Killed):
            os.close(fd)

    async def takes() -> None:
        fcntl.flock(os.open(bench.folder / "lock", os.O_RDWR), fcntl.LOCK_EX | fcntl.LOCK_NB)
        locked.append(True)
        bench.process.die()

    bench.live(holds)
    assert not bench.disk.open
    bench.process = bench.born()
    bench.live(takes)
    assert locked


def cut(bench: Bench, write: Callable[[Path], object], seeds: int = 60) -> set[bytes | None]:
    """What power cuts leave of a file after `write`: any of these contents, or none."""
    found: set[bytes | None] = set()
    for seed in range(seeds):
        path = bench.folder / "file"
        path.unlink(missing_ok=True)
        path.write_bytes(b"old")
        bench.disk.names.clear(), bench.disk.durable.clear()
        bench.process = bench.born()

        async def work() -> None:
            write(path)  # noqa: B023
            bench.process.die()

        bench.live(work, 1.0)
        bench.disk.cut_power(Random(seed))
        found.add(path.read_bytes() if path.exists() else None)
    return found


def test_a_power_cut_leaves_what_was_synced(bench: Bench) -> None:
    assert cut(bench, lambda path: write_atomically(path, b"a new one")) == {b"a new one"}


def test_a_power_cut_tears_what_was_not_synced(bench: Bench) -> None:
    found = cut(bench, lambda path: write_atomically(path, b"a new one", synced=False))
    assert {b"old", b"a new one", b"", b"a"} <= found and bytes(9) in found


def test_a_power_cut_may_lose_a_name_whose_folder_was_not_synced(bench: Bench) -> None:
    def rename(path: Path) -> None:
        with open(path.with_suffix(".new"), "wb") as file:
            file.write(b"a new one")
            file.flush()
            os.fsync(file.fileno())
        os.replace(path.with_suffix(".new"), path)

    assert cut(bench, rename) == {b"old", b"a new one"}


def test_a_new_file_in_a_new_folder_survives_a_power_cut(bench: Bench) -> None:
    def create(path: Path) -> None:
        made.append(path.with_name(f"new-{len(made)}") / "in" / "file")
        make_folder(made[-1].parent)
        (write_atomically if len(made) % 2 else create_atomically)(made[-1], b"whole")

    made: list[Path] = []
    cut(bench, create, 20)
    assert [each.read_bytes() for each in made] == [b"whole"] * 20


@pytest.mark.parametrize(
    "first",
    [
        lambda state: files.fresh(Settings(state=state)),
        lambda state: History(state / "history").append("PR P"),
        lambda state: Store(state).write("k", {}, 1, synced=False),
    ],
    ids=["the log", "the history", "what may be lost"],
)
def test_a_backup_survives_a_power_cut_whoever_made_the_state_folder(
    bench: Bench, first: Callable[[Path], object]
) -> None:
    def create(path: Path) -> None:
        state = path.with_name(f"state-{len(made)}")
        first(state)
        made.append(write_backup(state, datetime(2026, 1, 1), "l0", "a", ".mxt", "PG"))

    made: list[Path] = []
    cut(bench, create, 20)
    assert [each.read_bytes() for each in made] == [b"PG"] * 20


def test_a_new_file_whose_name_cannot_be_made_durable_is_not_there(make: Callable[..., Bench]) -> None:
    refused: list[int] = []

    async def work(bench: Bench, seed: int) -> None:
        try:
            create_atomically(bench.folder / "file", b"whole")
        except OSError:
            refused.append(seed)
            assert not [*bench.folder.iterdir()]
        bench.process.die()

    for seed in range(20):
        bench = make(Climate(1, {"fsync refused": 0.5}))
        bench.disk.rng = Random(seed)
        bench.live(partial(work, bench, seed))
        bench.disk.cut_power(Random(seed))
        assert (bench.folder / "file").exists() or seed in refused
    assert 0 < len(refused) < 20 and not bench.loop.defects


def test_a_new_folder_whose_name_cannot_be_made_durable_is_not_there(make: Callable[..., Bench]) -> None:
    async def work(bench: Bench) -> None:
        with pytest.raises(OSError):
            make_folder(bench.folder / "new" / "in")
        assert not [*bench.folder.iterdir()]
        bench.process.die()

    bench = make(Climate(1, {"fsync refused": 1.0}))
    bench.live(partial(work, bench))
    assert not bench.loop.defects


@pytest.mark.parametrize("kind", ["disk full", "fsync refused"])
def test_a_fault_of_the_disk_leaves_the_old_content(make: Callable[..., Bench], kind: str) -> None:
    bench = make(Climate(1, {kind: 0.5}))
    path = bench.folder / "x.json"
    raised: list[OSError] = []

    async def work() -> None:
        for number in range(30):
            try:
                Store(bench.folder).write("x.json", number)
            except OSError as problem:
                raised.append(problem)
            else:
                kept[0] = number
            assert int(path.read_text()) == kept[0]
        bench.process.die()

    kept = [-1]
    path.write_text("-1")
    bench.live(work)
    assert raised and kept[0] > 0 and not bench.loop.defects
    assert [*bench.folder.iterdir()] == [path]


def test_a_slow_disk_takes_time(make: Callable[..., Bench]) -> None:
    bench = make(Climate(1, {"slow disk": 1.0}))
    took: list[float] = []

    async def work() -> None:
        begun = bench.loop.now
        for _ in range(50):
            (bench.folder / "x").write_bytes(b"x")
        took.append(bench.loop.now - begun)
        bench.process.die()

    bench.live(work)
    assert took[0] > 1.0


def test_the_world_itself_meets_no_fault(make: Callable[..., Bench]) -> None:
    bench = make(Climate(1, {"disk full": 1.0}))
    with bench.disk.installed():
        (bench.folder / "x").write_text("x")
    assert bench.operations == []
