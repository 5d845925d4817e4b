"""The verb `/twin`."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.base.errors import Diagnostic
from multidrop.features.twins.twins import Twins
from multidrop.shell.session import Call


def list_twins(call: Call) -> None:
    """Print a row for each twin."""
    twins = call.session.hooks.part(Twins)
    rows = list(twins.rows())
    for row in rows:
        call.output(row, columns=True)
    call.output(f"limit at rest: {twins.limit} steps" if rows else "no twin runs; /twin on begins one")


async def on(call: Call, targets: Sequence[str]) -> None:
    """Begin twins of these drives, or of all of the selected line. Raises Diagnostic for a drive that is not there."""
    twins, workspace = call.session.hooks.part(Twins), call.session
    if not targets:
        bus = workspace.bus()
        if not bus.drives:
            raise Diagnostic(f"no drive has replied on {bus.name}", call.verb.name)
        return await twins.start(bus)
    drives = list(dict.fromkeys(call.drive(target) for target in targets))
    for drive in drives:
        bus = workspace.buses[drive.link.name]
        if bus.drives.get(drive.address) is not drive:
            what = f"no drive {drive.address} on {bus.name}"
            raise Diagnostic(what, call.verb.name, f"valid: {', '.join(bus.drives)}")
    for drive in drives:
        await twins.start(workspace.buses[drive.link.name], [drive.address])


def off(call: Call) -> None:
    """End all twins. Raises Diagnostic where there is none."""
    if not call.session.hooks.part(Twins).off():
        raise Diagnostic("no twin runs", call.verb.name)
    call.session.notify("all twins have ended")


def limit(call: Call, steps: int) -> None:
    """Set the steps by which a twin at rest may differ."""
    twins = call.session.hooks.part(Twins)
    twins.limit = steps
    call.session.notify(f"twins: the limit at rest is {twins.limit} steps")
