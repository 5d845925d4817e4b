"""Verbs for the names and the order of open buses, and for keeping them as saved connections."""

from __future__ import annotations

from multidrop.shell import tabs
from multidrop.shell.connect import settings
from multidrop.shell.verbs.registry import Call, verb


@verb("/rename NAME [BUS]", immediate=True)
async def rename(call: Call) -> None:
    """Give an open bus (by default the selected one) another name; moves nothing.

    /keep saves it under that name. A macro that names the bus keeps the name before.
    """
    name, *bus = call.words(1, 2)
    tabs.rename(call.workspace, call.workspace.bus(bus[0] if bus else ""), name)


@verb("/tab left|right [BUS]", immediate=True, words={"left": "before its neighbour", "right": "after its neighbour"})
async def tab(call: Call) -> None:
    """Move the tab of a bus, by default of the selected one; no drive moves."""
    where, *bus = call.words(1, 2)
    if where not in ("left", "right"):
        raise call.wrong()
    tabs.move(call.workspace, call.workspace.bus(bus[0] if bus else ""), 1 if where == "right" else -1)


@verb("/keep NAME [BUS]", immediate=True)
async def keep(call: Call) -> None:
    """Save an open bus (by default the selected one) as a connection: /open NAME opens it again.

    The configuration file keeps its remarks. A serial port is saved by its stable name.
    """
    name, *bus = call.words(1, 2)
    url = call.commands.url_of(call.workspace.bus(bus[0] if bus else ""))
    path = settings.save(name, url)
    call.workspace.notify(f"{path}: connection {name} is saved: {url}", outcome=True)
