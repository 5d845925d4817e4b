"""`multidrop plot`: plot drives until a signal."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence

from multidrop.dialects import Diagnostic, DriveError
from multidrop.shell.batch import runner
from multidrop.shell.plots.plot import begin
from multidrop.shell.plots.request import PlotTarget, parse_rate, parse_series, parse_target, read_first
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import report, write
from multidrop.transports import TransportLost


def run(
    url: str, drives: Sequence[str], *, to: str | None, serve: str | None, rate: str, reconnect: bool = True
) -> int:
    """Plot until a signal, which ends it well; return the exit code. `reconnect`: a lost bus leaves a gap."""
    try:
        target, period = parse_target(to, serve), parse_rate(rate)
    except Diagnostic as problem:
        write(sys.stderr, report(problem))
        return 2
    return runner.run(
        [url], lambda workspace: _until_ended(workspace, target, drives, period), interrupted=0, reconnect=reconnect
    )


async def _until_ended(workspace: Session, target: PlotTarget, drives: Sequence[str], period: float) -> None:
    series = parse_series(workspace, drives)
    await read_first(workspace, series)
    running, plot = await begin(workspace, target, series, period)
    write(sys.stderr, f"plotting to {running.where}, {running.rate}; Ctrl+C ends it")
    if running.desk:
        write(sys.stderr, f"at your desk: {running.desk}, then rerun {running.where}")
    try:
        losing = runner.until(workspace, lambda: lost(workspace))
        waits: list[asyncio.Task[object]] = [asyncio.create_task(plot.ended.wait()), asyncio.create_task(losing)]
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for each in waits:
                each.cancel()
        raise lost(workspace) or DriveError(plot.failure)
    finally:
        write(sys.stderr, await running.end())


def lost(workspace: Session) -> TransportLost | None:
    """The loss of a bus that is not tried again."""
    trying = workspace.reconnections.trying
    return next((bus.lost for bus in workspace.buses.values() if bus.lost and bus.name not in trying), None)
