"""Plots in files (`FILE.rrd` for rerun; tables as CSV or Parquet), and plots for the viewer of rerun."""

from __future__ import annotations

import argparse
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from multidrop.base.feature import Feature
from multidrop.shell.operations.operation import Forms, Operation
from multidrop.shell.plot_targets import PlotTargets

if TYPE_CHECKING:
    from pathlib import Path

    from multidrop.api.telemetry import Samples
    from multidrop.shell.plots.batch import Batch
    from multidrop.shell.verbs.call import Call

TO = "--to FILE.rrd|FILE.csv|FILE.parquet|rerun+http://HOST:PORT/proxy"
SERVE = "--serve [HOST:]PORT"
RATE = "--rate N|max"
VIEWERS = 9876
"""The port at which viewers of rerun connect by default."""


def _plot(chosen: argparse.Namespace) -> int:
    from multidrop.features.plot_files.command import run

    return run(
        chosen.url,
        [] if "all" in chosen.drive else chosen.drive,
        to=chosen.to,
        serve=chosen.serve,
        rate=chosen.rate,
        reconnect=not chosen.no_reconnect,
    )


async def _begin(call: Call, options: Mapping[str, str], texts: Sequence[str]) -> None:
    from multidrop.features.plot_files.verb import begin_typed

    await begin_typed(call, options, texts)


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
            command="plot",
            meaning=(
                "plot position, velocity and values until interrupted: to a file, or to a viewer served here or "
                "elsewhere"
            ),
            run=_plot,
            examples=(
                "plot 'sim:#press' --to run.rrd",
                "plot press --drive b --serve 9876",
                "plot press --to night.csv --rate 1",
                "plot press --to rerun+http://pc:9876/proxy",
            ),
            arguments={
                "URL": "what to open",
                "--drive ADDR ...": "a drive, or ADDR.WORD for a value that it prints (default: all drives)",
                RATE: {
                    "help": "samples a second of each drive, at most (default: 50); max: as fast as the line allows",
                    "default": "50",
                },
                "--to | --serve": {
                    TO: {
                        "help": "a file for rerun or a table (an existing one is added to), or a viewer elsewhere",
                        "default": None,
                    },
                    SERVE: {"help": "serve a viewer's data here", "default": None},
                },
                "--no-reconnect": "give up a lost connection, and do not try again",
            },
            after="macro",
        ),
        Forms(
            "/plot",
            usage=f"[ADDR ...] {TO} [{RATE}] | [ADDR ...] {SERVE} [{RATE}]",
            help="""
Plot drives and values on the screen, to rerun or into a table, with commands and replies, until /plot off.

ADDR is a drive (position and velocity): `b`, `press:b`, `press:*`; or a value that a drive prints: `VM`, `b.I1`.
`/plot b.I1` shows it on the screen. With --to or --serve, and without ADDR, it plots all drives of all open buses.
It reads only while a plot runs or is shown, each drive 50 times a second unless `--rate` says otherwise; `--rate
max` reads as fast as the line allows. `/plot FILE.rrd` is short for `/plot --to FILE.rrd`; `/plot` alone lists the
running plots. A table (CSV, Parquet) has a row for each value, state and line.
""",
            words={
                "--to": "into a file, or to a viewer",
                "--serve": "for viewers that connect",
                "--rate": "samples a second of each drive, or max",
            },
        ),
        PlotTargets(
            options=("--to", "--serve", "--rate"),
            endings=(".rrd", ".csv", ".parquet"),
            valid="--to FILE.rrd|.csv|.parquet or --serve [HOST:]PORT",
            files="FILE.csv or FILE.rrd",
            stream=f"--serve {VIEWERS}",
            begin=_begin,
            save=_save,
            read=_read,
        ),
    ),
    extras={"rerun": "rerun"},
)
