"""Plots that a person at a prompt or on the screen asks for: `/plot --to FILE`, and what the page of plots saves."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial

from multidrop.features.plot_files.plot import begin, write
from multidrop.features.plot_files.request import DEFAULT, parse_rate, parse_target
from multidrop.shell.plots.batch import Batch
from multidrop.shell.plots.series import parse_series, read_first
from multidrop.shell.verbs.call import Call


async def begin_typed(call: Call, options: Mapping[str, str], texts: Sequence[str]) -> None:
    """Begin what a line of `/plot` asks for, and say where it goes."""
    if options.keys() == {"--rate"}:
        raise call.wrong("no target for the plot")
    workspace = call.session
    target = parse_target(options.get("--to"), options.get("--serve"))
    if target.file is not None:
        call.output_file(str(target.file))
    period = parse_rate(options.get("--rate", DEFAULT))
    series = parse_series(workspace, texts)
    await read_first(workspace, series)
    begun, _ = await begin(workspace, target, series, period)
    workspace.notify(f"plotting to {begun.where}, {begun.rate}")
    if begun.desk:
        workspace.notify(f"at your desk: {begun.desk}, then {begun.viewer}")


def save(text: str) -> tuple[str, Callable[[Batch], Awaitable[None]]]:
    """The file that was typed, and what writes samples into it. Raises Diagnostic."""
    target = parse_target(text, None)
    return target.text, partial(write, target)
