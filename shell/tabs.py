"""The order and the names of open buses, which people change while these are open."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.shell.workspace import Workspace


def move(workspace: Workspace, bus: Bus, by: int) -> None:
    """Put a bus before or after its neighbour; at an end nothing happens."""
    order = list(workspace.buses.values())
    at = order.index(bus)
    if not 0 <= at + by < len(order):
        return
    order[at], order[at + by] = order[at + by], bus
    for number, each in enumerate(order):
        workspace.places[each] = number / len(order)  # below 1, and so before what opens later
    workspace.buses = {each.name: each for each in order}
    workspace.changed()


def rename(workspace: Workspace, bus: Bus, name: str) -> None:
    """Give an open bus another name. Raises Diagnostic, also while anything runs that knows it by its name."""
    before = bus.name
    if not re.fullmatch(r"[A-Za-z0-9_.-]{1,32}", name):
        raise Diagnostic(f"{name!r} is not a name", "/rename", "valid: letters, digits, -, _ and . (32 at most)")
    if name in workspace.buses:
        raise Diagnostic(f"a bus {name} is open already", "/rename", "give another name")
    if holds := _holder(workspace, bus):
        raise Diagnostic(f"{before} keeps its name while {holds}", "/rename", "rename it after that")
    bus.link.name = name
    workspace.buses = {each.name: each for each in workspace.buses.values()}
    if before in workspace.cells:
        workspace.cells[name] = workspace.cells.pop(before)
    if before in workspace.ports:
        workspace.ports[name] = workspace.ports.pop(before)
    workspace.addressed = {(name if each == before else each, address) for each, address in workspace.addressed}
    workspace.plotted = tuple(each._replace(bus=name) if each.bus == before else each for each in workspace.plotted)
    workspace.reconnections.rename(before, name)
    if workspace.selected_bus == before:
        workspace.selected_bus = name
    if workspace.renamed is not None:
        workspace.renamed(before, name)
    workspace.notify(f"{before} is {name} now", bus=name)
    workspace.changed()


def _holder(workspace: Workspace, bus: Bus) -> str:
    """The reason for which a bus keeps its name now; empty: it may change."""
    if bus.lost is not None:
        return "it is lost"
    if bus.name in workspace.raw:
        return "it is raw"
    if workspace.busy or workspace.playing:
        return "a macro, a wait or a transfer runs"
    if workspace.plots:
        return "a plot runs"
    if any(drive.link is bus.link for drive in workspace.debuggers):
        return "its program is watched"
    return "a macro is recorded" if workspace.recording else ""
