"""The verb that plots."""

from __future__ import annotations

from dialects import Diagnostic
from shell.verbs.registry import Call, as_typed, verb

USAGE = "/plot [[ADDR ...] --to FILE.rrd|rerun+http://HOST:PORT/proxy | [ADDR ...] --serve [HOST:]PORT | off]"
WORDS = {"--to": "into a file, or to a viewer", "--serve": "as a viewer connects", "off": "end all plots"}


@verb(USAGE, recorded=as_typed, words=WORDS)
async def plot(call: Call) -> None:
    """Plot position and velocity to rerun, with commands and replies, until /plot off or the end.

    All drives of all open buses unless some are named. `/plot` alone tells what is plotted. Drives are polled only
    while they are plotted or shown. `/plot FILE.rrd` is short for `/plot --to FILE.rrd`.
    """
    words = call.words()
    if not words:
        _tell(call)
    elif words == ["off"]:
        await _end(call)
    else:
        await _begin(call, words)


def _tell(call: Call) -> None:
    for each in call.session.plots:
        call.session.output(f"plotting to {each.plot.target.text}")
    if not call.session.plots:
        call.session.output("plotting: nothing")


async def _end(call: Call) -> None:
    if not call.session.plots:
        raise Diagnostic("nothing is plotted", "/plot")
    for each in list(call.session.plots):
        call.session.notify(await each.end())


async def _begin(call: Call, words: list[str]) -> None:
    from shell.plots import plotting
    from shell.plots.feed import parse_target

    options, addresses = _parse(call, words)
    target = parse_target(options.get("--to"), options.get("--serve"))
    begun = await plotting.begin(call.session, target, plotting.chosen(call.session, addresses))
    call.session.notify(f"plotting to {begun.plot.target.text}")


def _parse(call: Call, words: list[str]) -> tuple[dict[str, str], list[str]]:
    """The options, and the drives; a bare word that can only be a target is `--to`."""
    options: dict[str, str] = {}
    addresses: list[str] = []
    left = iter(words)
    for word in left:
        option = word
        if word in ("--to", "--serve", "--drive"):
            value = next(left, "")
        elif word.endswith(".rrd") or "://" in word:
            option, value = "--to", word
        else:
            option, value = "--drive", word
        if not value or option in options:
            raise call.wrong(f"{option} is given twice" if value else f"{option} wants a value")
        if option == "--drive":
            addresses.append(value)
        else:
            options[option] = value
    if not options:
        raise call.wrong("no place for the plot")
    return options, addresses
