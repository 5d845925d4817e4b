"""Cells that are served for the time of a test, and connections to them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from multidrop.simulator.cells import load
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import Served, serve_bus
from multidrop.simulator.serving.running import RunningFloor


@pytest.fixture
async def serve_text(tmp_path: Path) -> AsyncIterator[Callable[..., Awaitable[tuple[RunningFloor, list[Served]]]]]:
    """Serves the text of a cell, so many times as fast as the clock; gives its floor and its endpoints."""
    async with AsyncExitStack() as stack:

        async def start(text: str, speed: float = 1.0) -> tuple[RunningFloor, list[Served]]:
            path = tmp_path / "cell.toml"
            path.write_text(text, encoding="utf-8")
            floor = RunningFloor(Floor(load(path)), speed)
            stack.callback(floor.close)
            return floor, [each for bus in floor.floor.cell.buses for each in await serve_bus(floor, bus, stack)]

        yield start


@pytest.fixture
async def dial() -> AsyncIterator[Callable[[int], Awaitable[tuple[asyncio.StreamReader, asyncio.StreamWriter]]]]:
    """Opens connections, and closes them after the test."""
    writers: list[asyncio.StreamWriter] = []

    async def opened(port: int) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writers.append(writer)
        return reader, writer

    yield opened
    for writer in writers:
        writer.close()
