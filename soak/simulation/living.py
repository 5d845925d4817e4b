"""One seed lived: its world, everything of the system that is put in its place, and the story from begin to end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import shutil
import tempfile
import threading
from collections.abc import Callable, Collection, Coroutine, Iterable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any

from multidrop.base import registry
from multidrop.base.isolation import LOG
from multidrop.dialects.state import DriveState
from multidrop.drives.conversations import Conversations
from multidrop.features.usb import pipe as usb
from multidrop.simulator import wire
from multidrop.transports import pipe
from soak.simulation.acts.seams import SEAMS
from soak.simulation.lives import Lives
from soak.simulation.records.climate import Climate
from soak.simulation.records.history import History
from soak.simulation.records.places import drawn_places
from soak.simulation.story import tell
from soak.simulation.system.clock import Deadlock, SimulatedLoop
from soak.simulation.system.cut_ins import UP, CutIns
from soak.simulation.system.disk import Disk
from soak.simulation.system.threads import Scheduler
from soak.simulation.system.wall import Wall
from soak.simulation.world import World


@contextlib.contextmanager
def place_of_state() -> Iterator[Path]:
    """A folder for the files of one world."""
    folder = Path(tempfile.mkdtemp(prefix="simulate-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def lived(seed: int, steps: Iterable[int], keep: bool = False, without: Collection[str] = ()) -> World:
    """Live one seed: these steps of its story, `without` these kinds of faults."""
    climate = Climate.drawn(seed, without)
    places = drawn_places(Random(f"{seed} places"), Random(f"{seed} usb machine"))
    history = History(keep=keep)
    loops: list[SimulatedLoop] = []

    def factory() -> SimulatedLoop:
        loops.append(SimulatedLoop(Random(f"{seed} loop")))
        return loops[0]

    with place_of_state() as folder, _deadlocks(history), asyncio.Runner(loop_factory=factory) as runner:
        loop = runner.get_loop()
        assert isinstance(loop, SimulatedLoop)
        wall, scheduler = Wall(loop), Scheduler(loop, Random(f"{seed} threads"), climate["slow thread"])
        history.folder = str(folder)
        disk = Disk(f"{folder}/", loop, wall, climate, Random(f"{seed} disk"), partial(_noted, history, loop))
        cut_ins = CutIns(lambda name: history.count("stops held up" if name == UP else "cut-ins"), loop)
        world = World(seed, loop, history, climate, places, folder, wall, scheduler, disk, cut_ins)
        lives = Lives(world)

        async def life() -> None:
            await lives.begin()
            for step in steps:
                await tell(world, step)
            await lives.end()

        with ExitStack() as stack:
            stack.enter_context(wall.installed())
            stack.enter_context(scheduler.installed())
            stack.enter_context(disk.installed())
            stack.enter_context(world.kernel.installed())
            stack.enter_context(contextlib.chdir(folder))
            for seam in ((wire, "harmed", world.harmed), (Conversations, "keep", _kept(world)), *SEAMS):
                stack.enter_context(_replaced(*seam))
            stack.enter_context(_replaced(registry, "entries", lambda own=True: []))  # none of this machine's
            locks = SimpleNamespace(**{**vars(threading), "Lock": cut_ins.lock})
            for shared in (pipe, usb):
                stack.enter_context(_replaced(shared, "threading", locks))
            stack.callback(cut_ins.kill)
            stack.enter_context(_logged(history))
            with _deadlocks(history):
                runner.run(life())
        history.defects += cut_ins.deadlocks
        history.defects += [str(each.get("exception") or each.get("message")) for each in loop.defects]
    return world


@contextlib.contextmanager
def _deadlocks(history: History) -> Iterator[None]:
    """Note that the loop stands still, or never does, in a life and as its loop is closed."""
    try:
        yield
    except Deadlock as defect:
        history.defects.append(str(defect))


def _kept(world: World) -> Callable[[Conversations, DriveState], Coroutine[None, None, None]]:
    keep = Conversations.keep

    async def kept(conversations: Conversations, state: DriveState) -> None:
        if world.kept is not None:
            world.kept()
        await keep(conversations, state)

    return kept


def _noted(history: History, loop: SimulatedLoop, what: str, path: str) -> None:
    history.note(loop.now, f"disk {what}", path)


@contextlib.contextmanager
def _replaced(module: Any, name: str, value: Any) -> Iterator[None]:
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


@contextlib.contextmanager
def _logged(history: History) -> Iterator[None]:
    """Take what the product writes to its log of defects."""

    class Defects(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            cause = record.exc_info[1] if record.exc_info else ""
            history.defects.append(f"{record.getMessage()}: {cause!r}")

    handler, propagated = Defects(logging.ERROR), LOG.propagate
    LOG.addHandler(handler)
    LOG.propagate = False
    try:
        yield
    finally:
        LOG.propagate = propagated
        LOG.removeHandler(handler)
