"""The verb of twins: simulated drives beside real ones."""

from __future__ import annotations

from multidrop.dialects import Diagnostic
from multidrop.dialects.text import whole
from multidrop.shell.roles import RunningTwins
from multidrop.shell.verbs.registry import Call, as_typed, verb

MOST = 1_000_000_000
"""The largest limit, steps."""
WORDS = {
    "on": "run a twin beside each drive; read a drive again that has one",
    "off": "end all twins",
    "limit": "the steps by which a drive at rest may differ",
}


@verb("/twin [on [ADDR ...] | off | limit STEPS]", recorded=as_typed, words=WORDS)
async def twin(call: Call) -> None:
    """Run a simulated drive beside a real one, and warn where the two differ.

    `/twin on` reads each drive of the selected bus once, as a snapshot does, and sets a simulated one like it; ADDR is
    one drive: `b`, `press:b`. From then on the twin gets what the drive takes, and its inputs as they are read. A
    difference above the limit is a warning with its time and cause candidates, the likeliest first. The limit holds at
    rest; a move adds 30 ms of its velocity. Only position, velocity and inputs are read. `/twin` alone lists the twins.
    """
    twins = call.workspace.twins
    match call.words():
        case []:
            _list(call, twins)
        case ["on", *targets]:
            await _begin(call, twins, targets)
        case ["off"]:
            _end(call, twins)
        case ["limit", steps]:
            twins.limit = _steps(call, steps)
            call.workspace.notify(f"twins: the limit at rest is {twins.limit} steps")
        case _:
            raise call.wrong()


def _list(call: Call, twins: RunningTwins) -> None:
    rows = list(twins.rows())
    for row in rows:
        call.workspace.output(row, columns=True)
    call.workspace.output(f"limit at rest: {twins.limit} steps" if rows else "no twin runs; /twin on begins one")


async def _begin(call: Call, twins: RunningTwins, targets: list[str]) -> None:
    workspace = call.workspace
    if not targets:
        bus = workspace.bus()
        if not bus.drives:
            raise Diagnostic(f"no drive has replied on {bus.name}", call.verb.name)
        return await twins.start(bus)
    drives = list(dict.fromkeys(call.drive(each) for each in targets))
    for drive in drives:
        bus = workspace.buses[drive.link.name]
        if bus.drives.get(drive.address) is not drive:
            raise Diagnostic(
                f"no drive {drive.address} on {bus.name}", call.verb.name, f"valid: {', '.join(bus.drives)}"
            )
    for drive in drives:
        await twins.start(workspace.buses[drive.link.name], [drive.address])


def _end(call: Call, twins: RunningTwins) -> None:
    if not twins.off():
        raise Diagnostic("no twin runs", call.verb.name)
    call.workspace.notify("all twins have ended")


def _steps(call: Call, text: str) -> int:
    steps = whole(text, 1, MOST)
    if steps is None:
        raise call.wrong(f"no limit {text!r}: steps from 1 to {MOST}")
    return steps
