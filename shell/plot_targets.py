"""Where plots go beside the screen. The verb `/plot`, the page of plots and `multidrop.read_rrd` read it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.base import registry

if TYPE_CHECKING:
    from pathlib import Path

    from multidrop.shell.plots.batch import Batch

Call = Any
"""`shell.verbs.call.Call`: verbs know this module."""
OPTIONS = ("--to", "--serve", "--rate")
"""The options of a line of `/plot` with which a plot goes elsewhere; each has a value."""


class PlotTargets(NamedTuple):
    """Files, and programs that show plots."""

    endings: tuple[str, ...]
    """The ends of the names of files: a word of `/plot` with one of them needs no `--to` before it."""
    valid: str
    """The options of `/plot` that are valid where there is no screen."""
    files: str
    """What a person types who saves what the page of plots shows."""
    begin: Callable[[Call, Mapping[str, str], Sequence[str]], Awaitable[None]]
    """Begin a plot from a line of `/plot`: its options, and the texts of what it plots. Raises what the verb raises."""
    save: Callable[[str], tuple[str, Callable[[Batch], Awaitable[None]]]]
    """From the name of a new file that was typed: the file, and what writes samples into it. Both raise Diagnostic."""
    read: Callable[[str | Path, bool], Any]
    """`multidrop.read_rrd`, with its `twin`."""


def offered() -> PlotTargets | None:
    """The targets; None where no feature adds any."""
    return next(registry.added(PlotTargets), None)


def needed(word: str = "/plot --to") -> PlotTargets:
    """The targets, for a word of the registry that needs them. Raises Diagnostic where their feature is gone."""
    return registry.needed(PlotTargets, word)
