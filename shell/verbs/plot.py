"""The verb that plots."""

from __future__ import annotations

from multidrop.dialects import Diagnostic
from multidrop.shell.events import By
from multidrop.shell.plots.feed import begin
from multidrop.shell.plots.rate import DEFAULT, parse_rate
from multidrop.shell.plots.series import parse_series, read_first
from multidrop.shell.plots.target import parse_target
from multidrop.shell.verbs.registry import Call, as_typed, verb

USAGE = (
    "/plot [[ADDR ...] --to FILE.rrd|rerun+http://HOST:PORT/proxy [--rate N|max] | "
    "[ADDR ...] --serve [HOST:]PORT [--rate N|max] | ADDR ... | off]"
)
WORDS = {
    "--to": "into a file, or to a viewer",
    "--serve": "for viewers that connect",
    "--rate": "samples a second of each drive, or max",
    "off": "end all plots",
}


@verb(USAGE, recorded=as_typed, words=WORDS)
async def plot(call: Call) -> None:
    """Plot drives and values on the screen, or to rerun with commands and replies, until /plot off or the end.

    ADDR is a drive (position and velocity): `b`, `press:b`, `press:*`; or a value that a drive prints: `VM`, `b.I1`.
    `/plot b.I1` shows it on the screen. With --to or --serve, and without ADDR, it plots all drives of all open buses.
    It reads only while a plot runs or is shown, each drive 50 times a second unless `--rate` says otherwise; `--rate
    max` reads as fast as the line allows. `/plot FILE.rrd` is short for `/plot --to FILE.rrd`; `/plot` alone lists the
    running plots.
    """
    words = call.words()
    if not words:
        _list(call)
    elif words == ["off"]:
        await _end(call)
    else:
        await _begin(call, words)


def _list(call: Call) -> None:
    for each in call.workspace.plots:
        call.workspace.output(f"plotting to {each.where}, {each.rate}")
    if call.workspace.plotted:
        call.workspace.output(f"plotting on the screen: {' '.join(each.text for each in call.workspace.plotted)}")
    elif not call.workspace.plots:
        call.workspace.output("plotting: nothing")


async def _end(call: Call) -> None:
    workspace = call.workspace
    if not workspace.plots and not workspace.plotted:
        raise Diagnostic("no plot is running", "/plot")
    if workspace.plotted:
        workspace.plotted = ()
        workspace.changed()
    for each in list(workspace.plots):
        workspace.notify(await each.end())


async def _begin(call: Call, words: list[str]) -> None:
    workspace = call.workspace
    options, texts = _parse(call, words)
    if not options:
        return await _on_screen(call, texts)
    target = parse_target(options.get("--to"), options.get("--serve"))
    if target.file is not None:
        call.output_file(str(target.file))
    period = parse_rate(options.get("--rate", DEFAULT))
    series = parse_series(workspace, texts)
    await read_first(workspace, series)
    begun = await begin(workspace, target, series, period)
    workspace.notify(f"plotting to {begun.where}, {begun.rate}")
    if begun.desk:
        workspace.notify(f"at your desk: {begun.desk}, then rerun {begun.where}")


async def _on_screen(call: Call, texts: list[str]) -> None:
    """Show a plot on the screen; other plots go on."""
    workspace = call.workspace
    if workspace.screen is None:
        raise Diagnostic("no screen to plot on", "/plot", "valid here: --to FILE.rrd or --serve [HOST:]PORT")
    series = parse_series(workspace, texts)
    await read_first(workspace, series)
    workspace.plotted = series
    workspace.changed()
    if call.by is By.OPERATOR:  # a page that a macro or a script opens would take the keys of a person who types
        await workspace.screen("plot")


def _parse(call: Call, words: list[str]) -> tuple[dict[str, str], list[str]]:
    """The options, and what to plot; a bare word that can only be a target counts as `--to`."""
    options: dict[str, str] = {}
    addresses: list[str] = []
    left = iter(words)
    for word in left:
        option = word
        if word in ("--to", "--serve", "--rate", "--drive"):
            value = next(left, "")
        elif word.endswith(".rrd") or "://" in word:
            option, value = "--to", word
        else:
            option, value = "--drive", word
        if not value or option in options:
            raise call.wrong(f"{option} is given twice" if value else f"{option} needs a value")
        if option == "--drive":
            addresses.append(value)
        else:
            options[option] = value
    if options.keys() == {"--rate"}:
        raise call.wrong("no target for the plot")
    return options, addresses
