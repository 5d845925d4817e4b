"""Where plots go beside the screen. The verb `/plot`, the page of plots and `multidrop.read_rrd` read it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.base import registry

if TYPE_CHECKING:
    from pathlib import Path

    from multidrop.shell.plots.batch import Batch

_PLOT = "/plot "


class PlotTargets(NamedTuple):
    """Files, and programs that show plots."""

    valid: str
    """The options of `/plot` that are valid where there is no screen."""
    files: str
    """What a person types who saves what the page of plots shows."""
    stream: str
    """The end of the line of `/plot` that the page of plots types to show the same in a viewer."""
    save: Callable[[str], tuple[str, Callable[[Batch], Awaitable[None]]]]
    """From the name of a new file that was typed: the file, and what writes samples into it. Both raise Diagnostic."""
    read: Callable[[str | Path, bool], Any]
    """`multidrop.read_rrd`, with its `twin`."""

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return ("the place of plots outside the screen",)


def offered() -> PlotTargets | None:
    """The targets; None where no feature adds any."""
    return next(registry.added(PlotTargets), None)


def needed(word: str = "") -> PlotTargets:
    """The targets, for a word of the registry that needs them: one of `/plot`, unless another one is given.

    Raises Diagnostic where their feature is gone.
    """
    return registry.needed(PlotTargets, word or "".join(_words()[:1]))


def _words() -> list[str]:
    """The words of the registry that are options of `/plot`."""
    return [word for word in registry.words() if word.startswith(f"{_PLOT}-")]
