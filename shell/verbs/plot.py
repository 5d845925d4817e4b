"""The verb that plots."""

from __future__ import annotations

from dialects import Diagnostic
from shell.plots.feed import begin, chosen
from shell.plots.rate import DEFAULT, parse_rate
from shell.plots.target import parse_target
from shell.verbs.registry import Call, as_typed, verb

USAGE = (
    "/plot [[ADDR ...] --to FILE.rrd|rerun+http://HOST:PORT/proxy [--rate N|max] | "
    "[ADDR ...] --serve [HOST:]PORT [--rate N|max] | off]"
)
WORDS = {
    "--to": "into a file, or to a viewer",
    "--serve": "for viewers that connect",
    "--rate": "samples a second of each drive, or max",
    "off": "end all plots",
}


@verb(USAGE, recorded=as_typed, words=WORDS)
async def plot(call: Call) -> None:
    """Plot position and velocity to rerun, with commands and replies, until /plot off or the end.

    Without ADDR it plots all drives of all open buses. It polls drives only while they are plotted or shown, each 50
    times a second unless `--rate` says otherwise; `--rate max` polls as fast as the line allows.
    `/plot FILE.rrd` is short for `/plot --to FILE.rrd`; `/plot` alone lists the running plots.
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
    if not call.workspace.plots:
        call.workspace.output("plotting: nothing")


async def _end(call: Call) -> None:
    if not call.workspace.plots:
        raise Diagnostic("no plot is running", "/plot")
    for each in list(call.workspace.plots):
        call.workspace.notify(await each.end())


async def _begin(call: Call, words: list[str]) -> None:
    options, addresses = _parse(call, words)
    target = parse_target(options.get("--to"), options.get("--serve"))
    if target.file is not None:
        call.output_file(str(target.file))
    period = parse_rate(options.get("--rate", DEFAULT))
    begun = await begin(call.workspace, target, chosen(call.workspace, addresses), period)
    call.workspace.notify(f"plotting to {begun.where}, {begun.rate}")


def _parse(call: Call, words: list[str]) -> tuple[dict[str, str], list[str]]:
    """The options and the drives; a bare word that can only be a target counts as `--to`."""
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
    if not options.keys() - {"--rate"}:
        raise call.wrong("no target for the plot")
    return options, addresses
