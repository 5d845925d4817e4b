"""Plots that a person at a prompt or on the screen asks for: `/plot --to FILE`, and what the page of plots saves."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from functools import partial

from multidrop.features.plot_files.options import PlotOptions
from multidrop.features.plot_files.plot import USUAL_OPTIONS, begin, write
from multidrop.features.plot_files.request import parse_target
from multidrop.shell.plots.batch import Batch
from multidrop.shell.plots.series import parse_series, read_first
from multidrop.shell.session import Call
from multidrop.shell.verbs import plotting

ENDINGS = (".rrd", ".csv", ".parquet")


async def plot(call: Call, texts: Sequence[str], to: str | None, serve: str | None, options: PlotOptions) -> None:
    """Begin what a line of `/plot` asks for: on the screen, or beside it, and say where it goes.

    A word that can only be a target has `--to`.
    """
    targets = [text for text in texts if text.endswith(ENDINGS) or "://" in text]
    if len(targets) + (to is not None) > 1:
        raise call.wrong("--to is given twice")
    if targets:
        texts, to = [text for text in texts if text not in targets], targets[0]
    if to is None and serve is None:
        if options != USUAL_OPTIONS:
            raise call.wrong("no target for the plot")
        return await plotting.plot(call, texts)
    workspace = call.session
    target = parse_target(to, serve)
    if target.file is not None:
        call.output_file(str(target.file))
    series = parse_series(workspace, texts)
    await read_first(workspace, series)
    begun, _ = await begin(workspace, target, series, options)
    workspace.notify(f"plotting to {begun.where}, {begun.rate}")
    if begun.desk:
        workspace.notify(f"at your desk: {begun.desk}, then {begun.viewer}")


def save(text: str) -> tuple[str, Callable[[Batch], Awaitable[None]]]:
    """The file that was typed, and what writes samples into it. Raises Diagnostic."""
    target = parse_target(text, None)
    return target.text, partial(write, target)
