"""The verb that plots."""

from __future__ import annotations

from dialects import Diagnostic
from shell.registry import Call, as_typed, verb


@verb("/plot FILE.rrd | serve [HOST:]PORT | rerun+http://HOST:PORT/proxy | off  [ADDR ...]", recorded=as_typed)
async def plot(call: Call) -> None:
    """Plot position and velocity to rerun, with commands and replies, until /plot off or the end.

    All drives of all open buses unless some are named. `/plot` alone tells what is plotted. Drives are polled only
    while they are plotted or shown.
    """
    from shell import plotting
    from shell.plots import parse_target

    session, words = call.session, call.words()
    if not words:
        for each in session.plots:
            session.output(f"plotting to {each.plot.target.text}")
        if not session.plots:
            session.output("plotting: nothing")
        return
    if words == ["off"]:
        if not session.plots:
            raise Diagnostic("nothing is plotted", "/plot")
        for each in list(session.plots):
            session.narrate(await each.end())
        return
    serves = words[0] == "serve"
    if serves and len(words) < 2:
        raise call.wrong("no port to serve at")
    target = parse_target(None, words[1]) if serves else parse_target(words[0], None)
    drives = plotting.chosen(session, words[2 if serves else 1 :])
    begun = await plotting.begin(session, target, drives)
    session.narrate(f"plotting to {begun.plot.target.text}")
