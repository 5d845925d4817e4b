"""Plots on the screen: what `/plot` shows there, and the end of all plots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.shell import plot_targets
from multidrop.shell.events import By
from multidrop.shell.plots.series import parse_series, read_first

if TYPE_CHECKING:
    from multidrop.shell.session import Call, Session


def say(call: Call) -> None:
    """Say what is plotted."""
    session = call.session
    for plot in session.plots:
        call.output(f"plotting to {plot.where}, {plot.rate}")
    if session.plotted:
        call.output(f"plotting on the screen: {' '.join(series.text for series in session.plotted)}")
    elif not session.plots:
        call.output("plotting: nothing")


async def end(session: Session) -> None:
    """End all plots. Raises Diagnostic where there is none."""
    if not session.plots and not session.plotted:
        raise Diagnostic("no plot is running", "/plot")
    if session.plotted:
        session.plotted = ()
        session.changed()
    for plot in list(session.plots):
        session.notify(await plot.end())


async def plot(call: Call, texts: Sequence[str]) -> None:
    """Show a plot on the screen, while other plots go on; without texts, say what is plotted."""
    session = call.session
    if not texts:
        return say(call)
    if any("://" in text for text in texts):
        plot_targets.needed()
    screen = session.front.screen
    if screen is None:
        targets = plot_targets.offered()
        raise Diagnostic("no screen to plot on", "/plot", f"valid here: {targets.valid}" if targets is not None else "")
    series = parse_series(session, texts)
    await read_first(session, series)
    session.plotted = series
    session.changed()
    if call.by is By.OPERATOR:  # a page that a macro or a script opens would take the keys of a person who types
        await screen("plot")
