"""The verb `/twin`."""

from __future__ import annotations

from multidrop.base.errors import Diagnostic
from multidrop.base.text import whole
from multidrop.features.twins.twins import Twins
from multidrop.shell.verbs.call import Call

MOST = 1_000_000_000
"""The largest limit of twins, steps."""


async def twin(call: Call) -> None:
    twins, workspace = call.session.hooks.part(Twins), call.session
    match call.split():
        case []:
            rows = list(twins.rows())
            for row in rows:
                workspace.output(row, columns=True)
            workspace.output(f"limit at rest: {twins.limit} steps" if rows else "no twin runs; /twin on begins one")
        case ["on"]:
            bus = workspace.bus()
            if not bus.drives:
                raise Diagnostic(f"no drive has replied on {bus.name}", call.verb.name)
            await twins.start(bus)
        case ["on", *targets]:
            drives = list(dict.fromkeys(call.drive(each) for each in targets))
            for drive in drives:
                bus = workspace.buses[drive.link.name]
                if bus.drives.get(drive.address) is not drive:
                    what = f"no drive {drive.address} on {bus.name}"
                    raise Diagnostic(what, call.verb.name, f"valid: {', '.join(bus.drives)}")
            for drive in drives:
                await twins.start(workspace.buses[drive.link.name], [drive.address])
        case ["off"]:
            if not twins.off():
                raise Diagnostic("no twin runs", call.verb.name)
            workspace.notify("all twins have ended")
        case ["limit", text]:
            if (steps := whole(text, 1, MOST)) is None:
                raise call.wrong(f"no limit {text!r}: steps from 1 to {MOST}")
            twins.limit = steps
            workspace.notify(f"twins: the limit at rest is {twins.limit} steps")
        case _:
            raise call.wrong()
