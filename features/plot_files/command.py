"""`multidrop plot`: plot drives until a signal."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence

from multidrop.base.errors import DriveError
from multidrop.features.plot_files.options import PlotOptions
from multidrop.features.plot_files.plot import begin
from multidrop.features.plot_files.request import PlotTarget, parse_target
from multidrop.shell.batch import runner
from multidrop.shell.plots.poll import lost
from multidrop.shell.plots.series import parse_series, read_first
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import write


def run(
    url: str,
    drives: Sequence[str],
    *,
    to: str | None,
    serve: str | None,
    options: PlotOptions,
    reconnect: bool = True,
) -> int:
    """Plot until a signal, which ends it well; return the exit code. `reconnect`: a lost bus leaves a gap.

    Raises Diagnostic for a wrong target.
    """
    target = parse_target(to, serve)
    return runner.run(
        [url], lambda workspace: _until_ended(workspace, target, drives, options), interrupted=0, reconnect=reconnect
    )


async def _until_ended(workspace: Session, target: PlotTarget, drives: Sequence[str], options: PlotOptions) -> None:
    series = parse_series(workspace, drives)
    await read_first(workspace, series)
    running, plot = await begin(workspace, target, series, options)
    write(sys.stderr, f"plotting to {running.where}, {running.rate}; Ctrl+C ends it")
    if running.desk:
        write(sys.stderr, f"at your desk: {running.desk}, then {running.viewer}")
    try:
        losing = runner.until(workspace, lambda: lost(workspace))
        waits: list[asyncio.Task[object]] = [asyncio.create_task(plot.ended.wait()), asyncio.create_task(losing)]
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for wait in waits:
                wait.cancel()
        raise lost(workspace) or DriveError(plot.failure)
    finally:
        write(sys.stderr, await running.end())
