from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.drives.events import Sample
from multidrop.features.plot_files.plot import Plot
from multidrop.features.plot_files.request import PlotTarget, parse_target
from multidrop.transports import Unreachable
from tests.support.paths import ROOT
from tests.support.until import PATIENCE

EPOCH = 1_800_000_000.0


@pytest.mark.process
def test_rerun_is_not_loaded_before_a_plot_is_asked_for() -> None:
    code = (
        "import sys, multidrop.features.plot_files.plot; sys.exit('rerun' in sys.modules or 'pyarrow' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=PATIENCE).returncode == 0


async def test_a_missing_rerun_is_told_with_how_to_install_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(Diagnostic, match=r"not installed; pip install 'multidrop\[rerun\]'"):
        await open_plot(PlotTarget(file=tmp_path / "a.rrd"))
    assert os.listdir(tmp_path) == []


# Files


@dataclass
class Read:
    """What a file holds: rows by entity, each (elapsed, s; wall, s; values)."""

    rows: dict[str, list[tuple[float, float, Any]]] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    recordings: int = 0
    layouts: int = 0


def read(path: Path) -> Read:
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a file that was not closed has no table of contents, and says so
        reader = RrdReader(str(path))
    found = Read(recordings=len(reader.recordings()), layouts=len(reader.blueprints()))
    for chunk in reader.stream():
        batch = chunk.to_record_batch()
        if "SeriesLines:names" in batch.schema.names:
            found.names[chunk.entity_path] = batch.column("SeriesLines:names")[0].as_py()[0]
        if "elapsed" not in batch.schema.names:
            continue
        kinds = [name for name in ("Scalars:scalars", "TextLog:text", "TextLog:level") if name in batch.schema.names]
        columns = [batch.column(name) for name in ("elapsed", "time", *kinds)]
        for elapsed, wall, *values in zip(*columns, strict=True):
            row = (elapsed.value / 1e9, round(wall.value / 1e9, 6), *(value.as_py()[0] for value in values))
            found.rows.setdefault(chunk.entity_path, []).append(row)
    return found


async def open_plot(target: PlotTarget, now: float = 0.0) -> Plot:
    return await Plot.open(target, clock=lambda: now, wall=lambda at: datetime.fromtimestamp(EPOCH + at, UTC))


async def test_a_lost_bus_leaves_a_gap_in_its_curves(rerun: Any, tmp_path: Path) -> None:
    plot = await open_plot(PlotTarget(file=tmp_path / "run.rrd"))
    plot.sample("press", Sample(0.5, "b", 512, 0))
    plot.sample("eth", Sample(0.5, "!", 7, 0))
    plot.gap("press", 0.75)
    plot.sample("press", Sample(5.0, "b", 600, 0))
    await plot.close()
    rows = read(tmp_path / "run.rrd").rows
    assert sorted(rows["/press/b/position"]) == [
        (0.5, EPOCH + 0.5, 512.0),
        (0.75, EPOCH + 0.75),
        (5.0, EPOCH + 5, 600.0),
    ]
    assert len(rows["/press/b/velocity"]) == 3 and len(rows["/eth/\\!/position"]) == 1


async def test_samples_and_texts_are_found_in_the_file_on_both_time_lines(rerun: Any, tmp_path: Path) -> None:
    plot = await open_plot(PlotTarget(file=tmp_path / "run.rrd"), now=10.0)
    plot.text("press", "b", 10.25, "EX Ga", "command")
    plot.sample("press", Sample(10.5, "b", 512, -256))
    plot.sample("press", Sample(11.0, "b", 1024, 0))
    plot.sample("eth", Sample(11.0, "!", -7, 1))
    plot.sample("pmx", Sample(11.5, "00", 3, 4, "x"))
    plot.sample("old", Sample(11.5, "", 5, 6))
    plot.text("press", "", 12.0, "half a \ud800", "note")
    assert await plot.close() == f"5 samples in {tmp_path / 'run.rrd'}"
    found = read(tmp_path / "run.rrd")
    assert found.rows["/press/b/position"] == [(0.5, EPOCH + 10.5, 512.0), (1.0, EPOCH + 11.0, 1024.0)]
    assert found.rows["/press/b/velocity"] == [(0.5, EPOCH + 10.5, -256.0), (1.0, EPOCH + 11.0, 0.0)]
    assert found.rows["/eth/\\!/position"] == [(1.0, EPOCH + 11.0, -7.0)]
    assert found.rows["/pmx/00/x/velocity"] == [(1.5, EPOCH + 11.5, 4.0)]
    assert found.rows["/old/position"] == [(1.5, EPOCH + 11.5, 5.0)]
    assert found.rows["/press/log"] == [
        (0.25, EPOCH + 10.25, "b: EX Ga", "COMMAND"),
        (2.0, EPOCH + 12.0, "half a ?", "NOTE"),
    ]
    assert found.names["/press/b/velocity"] == "press b velocity (steps/s)"
    assert found.layouts == 1


@pytest.mark.process
async def test_a_second_plot_is_added_to_the_file_after_the_first(rerun: Any, tmp_path: Path) -> None:
    for play in (1, 2, 3):
        plot = await open_plot(PlotTarget(file=tmp_path / "run.rrd"), now=100.0 * play)
        plot.sample("press", Sample(100.0 * play, "abc"[play - 1], play, 0))
        plot.sample("press", Sample(100.0 * play + 2.0, "b", 10 * play, 0))
        await plot.close()
    found = read(tmp_path / "run.rrd")
    assert found.rows["/press/a/position"] == [(0.0, EPOCH + 100, 1.0)]
    assert found.rows["/press/b/position"] == [
        (2.0, EPOCH + 102, 10.0),
        (3.0, EPOCH + 200, 2.0),
        (5.0, EPOCH + 202, 20.0),
        (8.0, EPOCH + 302, 30.0),
    ]
    assert found.rows["/press/c/position"] == [(6.0, EPOCH + 300, 3.0)]
    assert (found.recordings, found.layouts) == (1, 1)
    assert os.listdir(tmp_path) == ["run.rrd"]
    subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(tmp_path / "run.rrd")], check=True, timeout=PATIENCE
    )


@pytest.mark.parametrize("data", [b"this is a text, not a recording" * 9, b"RRF2", b"RRF2" + b"\xff" * 500])
async def test_a_file_that_is_no_recording_is_left_as_it_is(rerun: Any, tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "run.rrd"
    path.write_bytes(data)
    with pytest.raises(Diagnostic, match=r"run\.rrd cannot be added to: .*use another file"):
        await open_plot(PlotTarget(file=path))
    assert path.read_bytes() == data
    assert os.listdir(tmp_path) == ["run.rrd"]


async def test_a_recording_of_another_program_is_left_as_it_is(rerun: Any, tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    other = rerun.RecordingStream("somebody_else")
    other.set_sinks(rerun.FileSink(str(path)))
    other.flush(timeout_sec=5)
    other.disconnect()
    before = path.read_bytes()
    with pytest.raises(Diagnostic, match="not a plot of multidrop"):
        await open_plot(PlotTarget(file=path))
    assert path.read_bytes() == before


async def test_a_file_that_is_plotted_to_is_refused_to_a_second_plot(rerun: Any, tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    target = PlotTarget(file=tmp_path / "run.rrd")
    plot = await open_plot(target)
    with pytest.raises(Diagnostic, match="another plot writes"):
        await open_plot(target)
    plot.sample("press", Sample(1.0, "b", 1, 1))
    await plot.close()
    assert read(tmp_path / "run.rrd").rows["/press/b/position"] == [(1.0, EPOCH + 1, 1.0)]


async def test_an_empty_file_is_written_and_one_in_no_folder_is_told(rerun: Any, tmp_path: Path) -> None:
    (tmp_path / "run.rrd").touch()
    plot = await open_plot(PlotTarget(file=tmp_path / "run.rrd"))
    plot.sample("press", Sample(1.0, "b", 1, 1))
    await plot.close()
    assert read(tmp_path / "run.rrd").rows["/press/b/position"]
    with pytest.raises(Diagnostic, match="cannot write"):
        await open_plot(PlotTarget(file=tmp_path / "no" / "run.rrd"))


CHILD = """
import asyncio, os, sys
from datetime import UTC, datetime
from multidrop.drives.events import Sample
from multidrop.features.plot_files import plot as plots, rerun_calls
from multidrop.features.plot_files.plot import Plot
from multidrop.features.plot_files.request import parse_target

async def main(to, limit):
    if limit:
        import resource
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    clock = asyncio.get_running_loop().time
    wall = lambda at: datetime.fromtimestamp(1.8e9 + at, UTC)
    plot = await Plot.open(parse_target(to, None), clock=clock, wall=wall)
    plot.on_failure(lambda reason: print("failed:", reason, flush=True))
    for number in range(100000):
        plot.sample("press", Sample(clock(), "b", number, 0))
        if plot.ended.is_set():
            break
        if number == 100:
            plots.BATCH_TIMEOUT, rerun_calls.FLUSH = 2.0, 1.0  # not before: a viewer that has just begun may be slow
            print("plotting", flush=True)
        await asyncio.sleep(0.01)

asyncio.run(main(sys.argv[1], int(sys.argv[2])))
"""


@pytest.fixture
def child() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    started: list[subprocess.Popen[str]] = []

    def start(to: Path | str, limit: int = 0, code: str = CHILD) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", code, str(to), str(limit)]
        started.append(subprocess.Popen(command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def kill_when_plotting(process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    assert process.stdout.readline() == "plotting\n"
    process.kill()
    process.wait(PATIENCE)


@pytest.mark.process
def test_a_killed_plot_loses_half_a_second_and_nothing_of_what_was_there(
    rerun: Any, tmp_path: Path, child: Callable[..., subprocess.Popen[str]]
) -> None:
    path, part = tmp_path / "run.rrd", tmp_path / "run.part.rrd"
    kill_when_plotting(child(path))
    first = read(path).rows["/press/b/position"]
    assert len(first) >= 50
    before = path.read_bytes()
    kill_when_plotting(child(path))
    assert path.read_bytes() == before
    added = read(part).rows["/press/b/position"]
    assert len(added) >= 50

    async def third() -> None:
        plot = await open_plot(PlotTarget(file=path))
        plot.sample("press", Sample(0.0, "b", -1, 0))
        await plot.close()

    asyncio.run(third())
    rows = sorted(read(path).rows["/press/b/position"])
    assert [row[2] for row in rows] == [row[2] for row in (*sorted(first), *sorted(added))] + [-1.0]
    assert os.listdir(tmp_path) == ["run.rrd"]


@pytest.mark.process
def test_a_file_that_takes_no_more_ends_the_plot_with_one_line_and_stays_readable(
    rerun: Any, tmp_path: Path, child: Callable[..., subprocess.Popen[str]]
) -> None:
    pytest.importorskip("resource")
    process = child(tmp_path / "run.rrd", 60_000)
    said, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert [line for line in said.splitlines() if line != "plotting"] == [said.splitlines()[-1]]
    assert "failed: plotting ended: cannot write" in said
    assert "what came before is in it" in said
    assert len(read(tmp_path / "run.rrd").rows["/press/b/position"]) > 20


# Viewers

VIEWER = """
import os, signal, sys
os.environ["RUST_LOG"] = "off"
import rerun
recording = rerun.RecordingStream("viewer")
recording.set_sinks(rerun.GrpcServerSink("127.0.0.1", int(sys.argv[1]), server_memory_limit="64MiB"))
print("up", flush=True)
signal.pause()
"""


def free_port() -> int:
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])


@pytest.mark.process
async def test_a_served_plot_is_found_by_a_viewer_that_comes_late_and_goes_on_in_the_next(
    rerun: Any, tmp_path: Path
) -> None:
    plot = await open_plot(PlotTarget(host="127.0.0.1"))
    assert plot.target.port
    plot.sample("press", Sample(1.5, "b", 512, 8))
    await plot.close()
    seen = tmp_path / "seen.rrd"
    command = ["-m", "rerun", "--save", str(seen), "--bind", "127.0.0.1", "--port", str(free_port())]
    viewer = await asyncio.create_subprocess_exec(
        sys.executable, *command, plot.target.text, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )

    async def came(count: int) -> list[tuple[float, float, Any]]:
        async with asyncio.timeout(60):
            while True:
                with contextlib.suppress(RuntimeError, ValueError):  # not there yet, or half written
                    rows = read(seen).rows.get("/press/b/position", [])
                    if len(rows) >= count:
                        return rows
                await asyncio.sleep(0.1)

    try:
        assert await came(1) == [(1.5, EPOCH + 1.5, 512.0)]
        again = await open_plot(plot.target, now=100.0)
        with pytest.raises(Diagnostic, match="cannot serve"):
            await open_plot(plot.target)
        again.sample("press", Sample(101.0, "b", 513, 8))
        await again.close()
        assert await came(2) == [(1.5, EPOCH + 1.5, 512.0), (3.5, EPOCH + 101, 513.0)]
    finally:
        viewer.kill()
        await viewer.wait()


async def test_a_port_in_use_is_told(rerun: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(Diagnostic, match=rf"cannot serve at 127\.0\.0\.1:{port} .*use another port"):
            await open_plot(PlotTarget(host="127.0.0.1", port=port))


async def test_a_viewer_that_is_not_there_is_told(rerun: Any) -> None:
    with pytest.raises(Unreachable, match="no viewer at .*start `rerun` there first"):
        await open_plot(parse_target(f"rerun+http://127.0.0.1:{free_port()}/proxy", None))


@pytest.mark.process
@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_a_viewer_that_dies_or_freezes_ends_the_plot_with_one_line_and_holds_up_nobody(
    rerun: Any, child: Callable[..., subprocess.Popen[str]], how: str
) -> None:
    port = free_port()
    viewer = child(str(port), code=VIEWER)
    assert viewer.stdout is not None and viewer.stdout.readline() == "up\n"
    closing = (
        CHILD.replace("if plot.ended.is_set():", "if plot.ended.is_set() or number == 250:").replace(
            "\nasyncio.run", "    await plot.close()\n\nasyncio.run"
        )
        if how == "SIGSTOP"
        else CHILD
    )
    process = child(f"rerun+http://127.0.0.1:{port}/proxy", code=closing)
    assert process.stdout is not None and process.stdout.readline() == "plotting\n"
    viewer.send_signal(getattr(signal, how))
    said, _ = process.communicate(timeout=PATIENCE)
    assert said.splitlines()[0].endswith(f"the viewer at rerun+http://127.0.0.1:{port}/proxy is gone")
    assert process.returncode == (1 if how == "SIGSTOP" else 0)
