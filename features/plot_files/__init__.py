"""Plots in files (`FILE.rrd` for rerun; tables as CSV or Parquet), and plots for the viewer of rerun."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Annotated

from multidrop.base.feature import Feature
from multidrop.features.plot_files.options import PlotOptions
from multidrop.shell.operations.argument_types import NoReconnect, Url
from multidrop.shell.operations.operation import Operation, typed
from multidrop.shell.operations.parameter import Argument, Listed, OneOf
from multidrop.shell.plot_targets import PlotTargets

if TYPE_CHECKING:
    from pathlib import Path

    from multidrop.api.telemetry import Samples
    from multidrop.shell.plots.batch import Batch
    from multidrop.shell.session import Call

VIEWERS = 9876
"""The port at which viewers of rerun connect by default."""
TARGET, ONE_TARGET = OneOf("target"), OneOf("one target", required=True)
TO = "FILE.rrd|FILE.csv|FILE.parquet|rerun+http://HOST:PORT/proxy"
FILE = (Listed.FILE,)
TypedTo = Annotated[str | None, Argument("into a file, or to a viewer", metavar=TO, listed=FILE, one_of=TARGET)]
TypedServe = Annotated[str | None, Argument("for viewers that connect", metavar="[HOST:]PORT", one_of=TARGET)]
Plotted = Annotated[str, Argument(metavar="ADDR", listed=(Listed.DRIVE, Listed.FILE))]
To = Annotated[
    str | None,
    Argument(
        "a file for rerun or a table (an existing one is added to), or a viewer elsewhere",
        metavar=TO,
        listed=FILE,
        one_of=ONE_TARGET,
    ),
]
Serve = Annotated[str | None, Argument("serve a viewer's data here", metavar="[HOST:]PORT", one_of=ONE_TARGET)]
OfUrl = Annotated[
    str,
    Argument(
        "a drive, or ADDR.WORD for a value that it prints (default: all drives)",
        metavar="ADDR",
        listed=(Listed.DRIVE,),
    ),
]


async def _typed(
    call: Call, *texts: Plotted, to: TypedTo = None, serve: TypedServe = None, options: PlotOptions
) -> None:
    from multidrop.features.plot_files.verb import plot

    await plot(call, texts, to, serve, options)


def _plot(
    url: Url,
    *,
    drive: tuple[OfUrl, ...] = (),
    options: PlotOptions,
    to: To = None,
    serve: Serve = None,
    no_reconnect: NoReconnect = False,
) -> int:
    from multidrop.features.plot_files.command import run

    drives = () if "all" in drive else drive
    return run(url, drives, to=to, serve=serve, options=options, reconnect=not no_reconnect)


def _save(text: str) -> tuple[str, Callable[[Batch], Awaitable[None]]]:
    from multidrop.features.plot_files.verb import save

    return save(text)


def _read(file: str | Path, twin: bool) -> Samples:
    from multidrop.features.plot_files.recorded import read

    return read(file, twin)


FEATURE = Feature(
    "plot_files",
    "plots in files, as tables, and in rerun",
    adds=(
        Operation(
            _plot,
            command="plot",
            meaning=(
                "plot position, velocity and values until interrupted: to a file, or to a viewer served here or "
                "elsewhere"
            ),
            examples=(
                "plot 'sim:#press' --to run.rrd",
                "plot press --drive b --serve 9876",
                "plot press --to night.csv --rate 1",
                "plot press --to rerun+http://pc:9876/proxy",
            ),
            after="macro",
        ),
        Operation(
            _typed,
            verb="/plot",
            extends=True,
            recorded=typed,
            help="""
Plot drives and values on the screen, to rerun or into a table, with commands and replies, until /plot off.

ADDR is a drive (position and velocity): `b`, `press:b`, `press:*`; or a value that a drive prints: `VM`, `b.I1`.
`/plot b.I1` shows it on the screen. With --to or --serve, and without ADDR, it plots all drives of all open buses.
It reads only while a plot runs or is shown, each drive 50 times a second unless `--rate` says otherwise; `--rate
max` reads as fast as the line allows. `/plot FILE.rrd` is short for `/plot --to FILE.rrd`; `/plot` alone lists the
running plots. A table (CSV, Parquet) has a row for each value, state and line.
""",
        ),
        PlotTargets(
            valid="--to FILE.rrd|.csv|.parquet or --serve [HOST:]PORT",
            files="FILE.csv or FILE.rrd",
            stream=f"--serve {VIEWERS}",
            save=_save,
            read=_read,
        ),
    ),
    extras={"rerun": "rerun"},
)
